"""Rules for corners, one side, a line between two things, a centre: robots against their places."""

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon

from ...tools.geometry.outline import FloatArray, distances
from ..tasks.task import Goal
from .grades import EVEN, STRICT_SHARE, Part
from .slots import even_along, match_slots

OFF = 0.1
"""Strict: least distance of a robot at a corner from the target, as a share of the tolerance."""


def corners(goal: Goal, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge whether one robot is at each of the rule's `points`, outside the target."""
    rule = goal.success
    slots, most = np.asarray(rule["points"], dtype=float), rule["tolerance_px"]
    near = distances(goal.target.region, points)
    stands = free & (near > 0) & (near >= rule.get("min_clearance_px", 0))
    held = np.full(len(points), -1, dtype=np.intp)
    held[stands] = match_slots(points[stands], slots, most)
    problems = list[str]()
    empty = len(slots) - int((held >= 0).sum())
    if empty:
        problems.append(f"{empty} of {len(slots)} corners without a robot within {most} px")
    if (near <= 0).any():
        problems.append(f"{int((near <= 0).sum())} on the target")
    strictly = match_slots(points[stands & (near >= OFF * most)], slots, STRICT_SHARE * most)
    short = len(slots) - int((strictly >= 0).sum())
    strict = (f"{short} corners not held within {STRICT_SHARE * most:.0f} px",) if short else ()
    return Part(held >= 0, 1.0, tuple(problems), strict)


def side(goal: Goal, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge a row on one side by the rule's `band_px` and `min_span_frac`."""
    rule, target = goal.success, Polygon(goal.target.polygon)
    name, (low, high) = rule["where"].partition(":")[2], rule["band_px"]
    axis = 0 if name in ("top", "bottom") else 1
    off = distances(target, points)
    there = _on_side(target, points, name)
    right = free & (off >= low) & (off <= high) & there
    problems = list[str]()
    if not there.all():
        problems.append(f"{int((~there).sum())} not on the {name} side")
    if (off < low).any() or (off > high).any():
        problems.append(
            f"{off.min():.0f} to {off.max():.0f} px from the target, {low}-{high} wanted"
        )
    wanted = rule["min_span_frac"] * float(np.ptp(np.asarray(goal.target.polygon)[:, axis]))
    span = float(np.ptp(points[right][:, axis])) if right.any() else 0.0
    if float(np.ptp(points[:, axis])) < wanted:
        problems.append(f"spans {span:.0f} px, {wanted:.0f} needed")
    whole = min(1.0, span / max(wanted, 1e-9))
    strict = _uneven(points[:, axis])
    return Part(right, whole, tuple(problems), strict, {"span_px": span})


def line_between(goal: Goal, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge robots on the segment between the rule's two `points`."""
    a, b = np.asarray(goal.success["points"], dtype=float)
    most = goal.success["tolerance_px"]
    off = distances(LineString([a, b]), points)
    problems = (f"{off.max():.1f} px off the line, {most} allowed",) if (off > most).any() else ()
    strict = [*_uneven((points - a) @ (b - a) / float(np.linalg.norm(b - a)))]
    if (off > STRICT_SHARE * most).any():
        strict.append(f"{off.max():.1f} px off the line, {STRICT_SHARE * most:.0f} wanted")
    return Part(free & (off <= most), 1.0, problems, tuple(strict))


def centre(goal: Goal, points: FloatArray, free: NDArray[np.bool_]) -> Part:
    """Judge robots at the first of the rule's `points`."""
    middle, most = np.asarray(goal.success["points"][0]), goal.success["tolerance_px"]
    off = np.linalg.norm(points - middle, axis=1)
    problems, strict = (), ()
    if (off > most).any():
        problems = (f"{off.max():.1f} px from the centre, {most} allowed",)
    if (off > STRICT_SHARE * most).any():
        strict = (f"{off.max():.1f} px from the centre, {STRICT_SHARE * most:.0f} wanted",)
    return Part(free & (off <= most), 1.0, problems, strict)


def _uneven(stations: FloatArray) -> tuple[str, ...]:
    if len(stations) < 3:
        return ()
    even = even_along(stations, EVEN)
    return () if even == len(stations) else (f"uneven: {even} of {len(stations)} on even places",)


def _on_side(target: Polygon, points: FloatArray, name: str) -> NDArray[np.bool_]:
    """Return which robots have nothing of the target between them and that side's border, (m,)."""
    far = 1e5
    way = {"left": (-far, 0), "right": (far, 0), "top": (0, -far), "bottom": (0, far)}[name]
    rays = shapely.linestrings(np.stack([points, points + way], axis=1))
    return ~np.asarray(shapely.intersects(rays, target), dtype=bool)
