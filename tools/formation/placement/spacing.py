"""Checks how robots are spread along the curve or over the corners a contract refers to."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from ...geometry.curves import FACING, Curve, locate
from ...geometry.outline import FloatArray, distances
from ...geometry.sampling import corner_points
from ..checking.verdict import TOLERANCE, Audit, Part
from .caging import escape_proof
from .place import corner_reach

WIDEST, NARROWEST = 1.5, 0.5
"""Even spacing: the greatest and least gap between neighbours, as multiples of the mean gap."""
NEAR_CURVE = 0.03
"""A robot within this share of a side curve's length of that curve stands on it."""
FACING_SLACK = math.radians(10)
"""How much further than FACING a robot's outward direction may be from that of its side."""
SIDE_SLACK = 0.1
"""At a corner two sides are equally near; a robot may be nearer to the other one by this share."""


def evenness(part: Part, curve: Curve, audit: Audit) -> None:
    """Check gaps between neighbours, measured along the curve, against their mean."""
    if len(part.points) < 2:
        return
    spread = _spread(part, curve)
    mean = float(np.mean(spread.gaps or [curve.length / len(part.points)]))
    if spread.gaps:
        audit.least("spacing_ratio", min(spread.gaps) / mean if mean > 0 else 0.0)
        audit.greatest("worst_gap_px", max(spread.gaps))
    for gap, (i, j) in zip(spread.gaps, spread.pairs, strict=True):
        if gap > WIDEST * mean + TOLERANCE:
            audit.find("gap", gap, WIDEST * mean, robot=i, others=(j,))
        elif gap < NARROWEST * mean - TOLERANCE:
            audit.find("crowded", gap, NARROWEST * mean, robot=i, others=(j,))
    _pieces(spread, mean, audit)


def _pieces(spread: "_Spread", mean: float, audit: Audit) -> None:
    """Check the ends of open curves, and gaps between or bare pieces, against the mean gap."""
    for apart, (i, j) in spread.jumps:
        if apart < NARROWEST * mean - TOLERANCE:
            audit.find("crowded", apart, NARROWEST * mean, robot=i, others=(j,))
    for i, stretch in spread.ends:
        if stretch > mean + TOLERANCE:
            audit.find("bare_end", stretch, mean, robot=i)
    for stretch in spread.bare:
        if stretch > mean + TOLERANCE:
            audit.find("bare_stretch", stretch, mean)


def on_curve(part: Part, curve: BaseGeometry, reach: float, name: str, audit: Audit) -> None:
    """Check that every robot is within `reach` px of the curve."""
    distance = distances(curve, part.points)
    for i in np.flatnonzero(~(distance <= reach + TOLERANCE)):
        audit.find("off_curve", distance[i], reach, robot=part.first + i, about=name)


def on_side(part: Part, curve: Curve, direction: tuple[float, float], audit: Audit) -> None:
    """Check that every robot is on the side's curve or faces a part of the target on that side."""
    feet = shapely.shortest_line(part.outline.envelope, shapely.points(part.points))
    outward = np.diff(shapely.get_coordinates(feet).reshape(-1, 2, 2), axis=1)[:, 0]
    unit = np.asarray(direction) / np.linalg.norm(direction)
    facing = outward @ unit / np.maximum(np.linalg.norm(outward, axis=1), 1e-9)
    astray = distances(curve.geometry(), part.points) > NEAR_CURVE * curve.length
    for i in np.flatnonzero(astray & (facing < math.cos(FACING + FACING_SLACK))):
        turned = math.degrees(math.acos(float(np.clip(facing[i], -1, 1))))
        most = math.degrees(FACING)
        audit.find("wrong_side", turned, most, robot=part.first + i, unit="degrees")


def on_edges(part: Part, edges: tuple[int, ...], audit: Audit) -> None:
    """Check that every robot's nearest edge is one of those chosen."""
    vertices, pairs = part.outline.graph()
    off = np.stack([distances(LineString(vertices[list(p)]), part.points) for p in pairs])
    nearest, chosen = off.min(axis=0), off[list(edges)].min(axis=0)
    for i in np.flatnonzero(chosen > nearest * (1 + SIDE_SLACK) + TOLERANCE):
        edge = f"edge {int(np.argmin(off[:, i]))}"
        audit.find("wrong_edge", chosen[i] - nearest[i], robot=part.first + i, about=edge)


def enclosure(part: Part, curve: Curve, audit: Audit) -> None:
    """Check a closed ring: the robots' polygon contains the target, no opening is too wide.

    An escape-proof cage is judged by its certificate, and its openings only if a `max_gap` is
    stated.
    """
    order = np.argsort(stations_on(part.points, curve)[0], kind="stable")
    points = part.points[order]
    opening = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1) - 2 * part.radius
    allowed = part.group.max_gap
    if allowed is None:
        even = WIDEST * curve.whole_length / len(points)
        allowed = np.inf if escape_proof(part.group) else even
    audit.greatest("widest_opening_px", opening.max())
    audit.measures["min_width_px"] = round(part.outline.min_width, 2)
    if opening.max() > part.outline.min_width:
        wide, narrow = part.site.length(opening.max()), part.site.length(part.outline.min_width)
        audit.notes.append(
            f"The widest opening, {wide}, is wider than {part.group.targets[0]} at its narrowest, "
            f"{narrow}."
        )
    encloses = len(points) > 2 and shapely.make_valid(Polygon(points)).contains(
        shapely.Point(part.outline.centre)
    )
    if not encloses and not escape_proof(part.group):
        about = part.group.targets[0]
        audit.find("not_enclosed", len(points), 3, about=about, unit="robots")
    kind = "opening" if curve.closed else "opening_at_border"
    needed = count_for_max_gap(part, curve)
    for k in np.flatnonzero(opening > allowed + TOLERANCE):
        robot, other = part.first + order[k], part.first + order[(k + 1) % len(order)]
        audit.find(kind, opening[k], allowed, robot=robot, others=(other,), needed=needed)


def count_for_max_gap(part: Part, curve: Curve) -> int | None:
    """Return how many robots make openings as narrow as `max_gap`, if more robots are needed.

    None if more would not help, would be too close together, or the curve is not closed.
    """
    widest = part.group.max_gap
    if not widest or not curve.closed:
        return None
    needed = math.ceil(curve.length / (widest + 2 * part.radius))  # chords are shorter than arcs
    apart = curve.length / needed
    return None if needed <= len(part.points) or apart < (part.group.min_spacing or 0) else needed


def corner_matching(part: Part, audit: Audit) -> None:
    """Check that there is a one-to-one matching of robots to corners within reach."""
    from scipy.optimize import linear_sum_assignment

    corners = corner_points(part.outline, part.group.robots)
    if part.group.robots > len(corners):
        audit.find("corners", part.group.robots, len(corners), unit="robots")
        return
    reach = corner_reach(part.group, part.outline, part.radius)
    distance = np.linalg.norm(part.points[:, None] - corners[None], axis=2)
    cost = distance + 1e6 * (distance > reach)
    robots, matched = linear_sum_assignment(cost)
    audit.greatest("max_from_corner_px", distance[robots, matched].max())
    for i, k in zip(robots, matched, strict=True):
        if distance[i, k] > reach[k] + TOLERANCE:
            x, y = corners[k]
            about = f"its corner ({x:.0f}, {y:.0f})"
            audit.find("off_corner", distance[i, k], reach[k], robot=part.first + i, about=about)


def stations_on(points: FloatArray, curve: Curve) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return each point's arc length along the curve, pieces end to end, px, and its piece.

    Both are (n,).
    """
    if len(curve.lines) == 1:
        return locate(curve.lines[0], points), np.zeros(len(points), dtype=np.intp)
    lines = [LineString(line) for line in curve.lines]
    piece = np.argmin(np.stack([distances(line, points) for line in lines]), axis=0)
    starts = np.concatenate([[0.0], np.cumsum([line.length for line in lines])])
    along = np.stack([locate(line, points) for line in curve.lines])
    return starts[piece] + along[piece, np.arange(len(points))], piece


@dataclass(frozen=True)
class _Spread:
    """Robots along a curve, in px: gaps, with the robots on either side, ends and bare pieces.

    `ends` are the lengths beyond the outermost robots of a piece. `jumps` are distances from the
    last robot of a piece to the first of the next, along both pieces and straight across the cut;
    the straight distance between the robots would mean nothing where a recess is bridged.
    """

    gaps: list[float]
    pairs: list[tuple[int, int]]
    ends: list[tuple[int, float]]
    bare: list[float]
    jumps: list[tuple[float, tuple[int, int]]]


def _spread(part: Part, curve: Curve) -> _Spread:
    station, piece = stations_on(part.points, curve)
    order = np.argsort(station, kind="stable")
    names = [int(i) + part.first for i in order]
    cut = 0.0 if curve.closed else curve.cut(len(part.points))
    if cut is not None:
        around = np.diff(station[order], append=station[order[0]] + curve.length + cut)
        pairs = list(zip(names, names[1:] + names[:1], strict=True))
        return _Spread([float(g) for g in around], pairs, [], [], [])
    spread = _Spread([], [], [], [], [])
    start, last, since = 0.0, None, 0.0
    for k, line in enumerate(curve.lines):
        mine = [(float(station[i]) - start, int(i) + part.first) for i in order if piece[i] == k]
        length = float(LineString(line).length)
        start += length
        since += float(np.linalg.norm(line[0] - curve.lines[k - 1][-1]))
        if not mine:
            spread.bare.append(length)
            since += length
            continue
        if last is not None:
            spread.jumps.append((since + mine[0][0], (last, mine[0][1])))
        last, since = mine[-1][1], length - mine[-1][0]
        for (a, i), (b, j) in pairwise(mine):
            spread.gaps.append(b - a)
            spread.pairs.append((i, j))
        spread.ends.extend([(mine[0][1], mine[0][0]), (mine[-1][1], length - mine[-1][0])])
    return spread
