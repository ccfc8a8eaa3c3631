"""Geometry of a formation about a true outline: gaps around it, directions, arrangements."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import Polygon

from ...tools.geometry.outline import FloatArray
from ..tasks.task import Thing
from .dialogue_states import Case, State, distances_to
from .slots import match_slots

SIDES = {"left": (-1, 0), "right": (1, 0), "top": (0, -1), "bottom": (0, 1)}
GATHERED = 0.5
"""Robots at a centre are at most this share of the thing's size away from it."""
CORNER, BORDER = 0.35, 1.5
"""A robot is at a corner within this share of the size; within so many px it is still inside."""


@dataclass(frozen=True)
class Gaps:
    """Gaps between neighbours around a thing.

    Attributes:
        arcs: length of each along the line that robots stand on, px.
        chords: from robot to robot, px.
        middles: the point of that line in the middle of each, (n, 2) px.
        winds: whether the robots go round the thing.
    """

    arcs: FloatArray
    chords: FloatArray
    middles: FloatArray
    winds: bool


def gaps_around(thing: Thing, points: FloatArray) -> Gaps:
    """Return the gaps of a ring, measured along the outline at the robots' median distance."""
    far = float(np.median(distances_to(thing, points)))
    hull = Polygon(thing.polygon)
    way = hull.buffer(max(far, 1.0)).exterior
    station = np.asarray(shapely.line_locate_point(way, shapely.points(points)), dtype=float)
    order = np.argsort(station, kind="stable")
    station, ring = station[order], points[order]
    arcs = np.diff(station, append=station[0] + way.length)
    middle = shapely.line_interpolate_point(way, (station + arcs / 2) % way.length)
    turns = np.arctan2(*(ring - shapely.get_coordinates(hull.centroid)[0]).T[::-1])
    around = (np.diff(turns, append=turns[0]) + np.pi) % (2 * np.pi) - np.pi
    return Gaps(
        arcs,
        np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1),
        shapely.get_coordinates(middle),
        len(ring) > 2 and abs(round(float(around.sum() / (2 * np.pi)))) == 1,
    )


def way_of(towards: Any, case: Case, here: ArrayLike) -> float:
    """Return the direction, degrees clockwise from the right, of a side or of a thing from here.

    Degrees are returned as they are.
    """
    if towards in SIDES:
        x, y = SIDES[towards]
    elif towards in case.things:
        x, y = np.asarray(case.things[towards].outline.centre) - np.asarray(here)
    else:
        return float(towards)
    return float(np.degrees(np.arctan2(y, x)))


def angle_off(ways: FloatArray, degrees: float) -> Any:
    """Return how far vectors (..., 2) are off a direction, degrees, 0 to 180."""
    angle = np.degrees(np.arctan2(ways[..., 1], ways[..., 0]))
    return abs((angle - degrees + 180) % 360 - 180)


def box_direction(thing: Thing, points: FloatArray) -> FloatArray:
    """Return points seen from a thing's middle, its box stretched to a square of side 2, (n, 2)."""
    x0, y0, x1, y1 = thing.outline.bounds
    middle, half = np.array([x0 + x1, y0 + y1]) / 2, np.array([x1 - x0, y1 - y0]) / 2
    return (points - middle) / half


def neighbour_distance(state: State) -> float:
    """Return the mean distance of a robot to the nearest other, px; 0 for a single one."""
    points = state.positions
    if len(points) < 2:
        return 0.0
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    return float((apart + np.eye(len(points)) * 1e9).min(axis=1).mean())


def form_problems(case: Case, form: str) -> Iterator[str]:
    """Yield what keeps robots from standing inside, around, at the corners, ... of their things."""
    if form in BY_THEMSELVES:
        yield from BY_THEMSELVES[form](case)
        return
    for thing, points in case.rings():
        problem = _form_problem(form, thing, points)
        if problem:
            yield f"{problem} of the {thing.name}: the form {form} is wanted"


def _form_problem(form: str, thing: Thing, points: FloatArray) -> str:
    off = distances_to(thing, points)
    if form == "inside":
        return f"{int((off > BORDER).sum())} robots are out" if (off > BORDER).any() else ""
    if form == "centre":
        far = float(np.linalg.norm(points - np.asarray(thing.outline.centre), axis=1).max())
        return (
            f"a robot is {far:.0f} px off the middle" if far > GATHERED * thing.outline.size else ""
        )
    if (off <= 0).any():
        return f"{int((off <= 0).sum())} robots are on the outline or inside"
    if form == "around":
        return "" if gaps_around(thing, points).winds else "robots do not go round the middle"
    box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(thing.region))[:4]
    held = set(match_slots(points, box, CORNER * thing.outline.size).tolist()) - {-1}
    return "" if len(held) >= min(4, len(points)) else f"robots are at {len(held)} corners"


def _line_held(case: Case) -> Iterator[str]:
    """Yield a problem unless robots stand in a straight line."""
    about = case.after.positions - case.after.positions.mean(0)
    along, across = (about @ np.linalg.svd(about, full_matrices=False)[2].T).T[:2]
    off = float(abs(across).max())
    if off > max(3.0, 0.03 * float(np.ptp(along))):
        yield f"no straight line: {off:.0f} px off"


def _circle(case: Case) -> Iterator[str]:
    points = case.after.positions
    radius = np.linalg.norm(points - points.mean(0), axis=1)
    if radius.std() > 0.05 * radius.mean():
        yield f"no circle: {radius.min():.0f} to {radius.max():.0f} px from its middle"


def _between(case: Case) -> Iterator[str]:
    first, second = list(case.things.values())[:2]
    a, b = np.asarray(first.outline.centre), np.asarray(second.outline.centre)
    share = (case.after.positions - a) @ (b - a) / float((b - a) @ (b - a))
    hull = shapely.union(first.region, second.region).convex_hull.buffer(3.0)
    within = shapely.contains_xy(hull, case.after.positions)
    if not within.all() or share.min() < 0 or share.max() > 1:
        yield f"robots are not all between the {first.name} and the {second.name}"


BY_THEMSELVES = {"between": _between, "line": _line_held, "circle": _circle}
"""Forms that are not judged for each thing separately."""
