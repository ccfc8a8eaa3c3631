"""Marks on a photograph: what a contract demands, and the robots.

Nothing is decided here: positions come from the references that the checker measures against.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry import LineString, MultiLineString
from shapely.geometry.base import BaseGeometry

from ..formation.checking.allowed import allowed_area, curve_of
from ..formation.checking.verdict import Part, parts_of
from ..formation.contract import OUTSIDE, Contract
from ..formation.placement.place import Site
from ..geometry.curves import Curve
from ..geometry.outline import FloatArray, Outline, distances
from ..geometry.sampling import corner_points, nearest
from .canvas import (
    ALLOWED,
    FINDING,
    FORBIDDEN,
    IDLE,
    INK,
    MET,
    PAPER,
    ROBOT,
    TARGET,
    WHITE,
    Canvas,
    Labels,
)

OUTLINE_DETAIL = 0.3
"""Greatest distance of a drawn outline from the measured one, units of the page."""
HEADING_TICK = 2.2
"""Length of a heading tick from the robot's centre, as a multiple of its disc's radius."""
LABEL = 17.0
NUMBERED = 60
"""The most robots that are drawn with their numbers."""
SIZES = ((NUMBERED, (5.5, 14.0)), (400, (3.0, 8.0)), (np.inf, (1.3, 4.0)))
"""For up to this many robots: the least and greatest radius they are drawn with, units."""
NEIGHBOUR_SHARE = 0.42
"""A disc's greatest radius as a share of the distance to the nearest neighbour."""
WAY_START = 3.0
"""Radius of the circle at which a robot's way begins, units of the page."""
NUMBER_RADIUS = 9.5
"""Least radius of a disc on which a number is legible, units of the page."""


@dataclass(frozen=True)
class Opening:
    """The widest gap of a ring: its middle (2,), image pixels, and its width, px."""

    middle: FloatArray
    width: float


def draw_areas(canvas: Canvas, contract: Contract, site: Site, points: FloatArray) -> None:
    """Tint where robots may stand and where none may, then draw every target's outline."""
    picture = shapely.box(-0.5, -0.5, site.width - 0.5, site.height - 0.5)
    for part in parts_of(contract, points, site):
        area = allowed_area(part)
        if area is not None:
            shown = area.intersection(picture)
            canvas.tint(shown, ALLOWED, 0.26)
            canvas.strokes(rings(shown), ALLOWED, 1.0, 0.8)
    for name in contract.keep_out:
        canvas.tint(site.solid(name, contract), FORBIDDEN, 0.35)
    for name in contract.target_ids:
        draw_outline(canvas, site.outlines[name])


def draw_outline(canvas: Canvas, outline: Outline, colour: tuple[int, int, int] = TARGET) -> None:
    """Draw an outline and its holes as a light line with dark seams."""
    simple = outline.polygon.simplify(OUTLINE_DETAIL / canvas.page_length(1.0))
    canvas.cased(rings(simple), colour, 2.6)


def draw_met(canvas: Canvas, outlines: Iterable[Outline]) -> None:
    """Tint and outline other things that robots stand on or drive over."""
    for outline in outlines:
        canvas.tint(outline.polygon, MET, 0.25)
        draw_outline(canvas, outline, MET)


def draw_guides(canvas: Canvas, contract: Contract, site: Site, points: FloatArray) -> None:
    """Draw what each group is lined up with.

    A curve (a ring, side or line), the straight gaps of a cage and the polygon through the corners
    are dashed, the ways from robots to their corners solid; a centre is marked by a cross.
    """
    for part in parts_of(contract, points, site):
        if not len(part.points):
            continue
        if part.group.relation == "corners":
            corners = corner_points(part.outline, part.group.robots)
            canvas.dashes([np.concatenate([corners, corners[:1]])], WHITE, 0.8)
            canvas.cased(_corner_links(part, corners), WHITE, 1.5)
            for corner in corners:
                canvas.disc(corner, 2.0, INK, 1.2)
        elif part.group.relation == "centre":
            canvas.cross(np.asarray(part.outline.centre), 6, WHITE, 1.6)
        else:
            canvas.dashes(_guides(part), WHITE, 1.5)


def label_openings(
    canvas: Canvas, contract: Contract, site: Site, points: FloatArray, labels: Labels
) -> None:
    """Label every ring's widest gap, as the checker measures it.

    The width is in px, or in metres where the scale is known.
    """
    for part in parts_of(contract, points, site):
        opening = _widest_opening(part)
        if opening is None:
            continue
        spec = ".0f" if opening.width >= 10 else ".1f"
        text = site.length(opening.width, spec).partition(" (")[0]
        middle = canvas.at(opening.middle[None])[0]
        away = middle - canvas.at(np.array([part.outline.centre]))[0]
        size = canvas.chip_size(text, LABEL)
        where = labels.place(middle, size, away, 6 * canvas.unit)
        canvas.chip(where, text, LABEL, INK, PAPER)


def robot_size(canvas: Canvas, points: FloatArray, room: float = np.inf) -> float:
    """Return the radius to draw robots with, units of the page, so that neighbours do not touch.

    Args:
        canvas: the page they are drawn on.
        points: (n, 2), where they stand, image pixels.
        room: greatest radius that keeps clear of other things, source px; exceeded where a disc
            would be too small to see.
    """
    count = len(points)
    least, most = next(size for limit, size in SIZES if count <= limit)
    if count > 1:
        # A quantile, so that a few misplaced robots do not shrink all discs.
        apart = np.quantile(nearest(points, points, 2)[0][:, 1], 0.1)
        room = min(room, NEIGHBOUR_SHARE * float(apart))
    return float(np.clip(canvas.page_length(room), least, most))


def target_room(contract: Contract, site: Site, points: FloatArray) -> float:
    """Return the room that most robots outside a target have for their discs, px.

    It is the 0.2 quantile of their distances from the target's edge and, of robots at corners, of
    half their distances from the nearest corner. Robots exactly on corners do not count. Infinite
    if there are no others outside a target.
    """
    away: list[FloatArray] = []
    for part in parts_of(contract, points, site):
        outside = part.group.relation in OUTSIDE and not part.group.on_corners
        if not outside or not len(part.points):
            continue
        away.append(distances(part.outline.polygon.boundary, part.points))
        if part.group.relation == "corners":
            corners = corner_points(part.outline, part.group.robots)
            away.append(nearest(corners, part.points, 1)[0] / 2)
    return float(np.quantile(np.concatenate(away), 0.2)) if away else np.inf


def draw_robots(
    canvas: Canvas, points: Mapping[str, FloatArray], radius: float, flagged: Collection[str] = ()
) -> None:
    """Draw the robots as discs at their exact places.

    Args:
        canvas: the page to draw on.
        points: place (2,) of each robot by its id, image pixels.
        radius: radius of the discs, units of the page.
        flagged: robots to draw in red with a cross, above the others.
    """
    rim = float(np.clip(0.17 * radius, 0.6, 1.9))
    for robot in sorted(points, key=lambda r: r in flagged):
        if robot in flagged:
            canvas.disc(points[robot], radius, FINDING, rim)
            canvas.cross(points[robot], 0.45 * radius, WHITE, max(0.2 * radius, 0.8))
        else:
            canvas.disc(points[robot], radius, ROBOT, rim)


def draw_headings(
    canvas: Canvas, points: FloatArray, headings: Sequence[float | None], radius: float
) -> None:
    """Draw a heading tick on each robot that has a heading; call this before drawing the discs.

    Headings are in degrees, from x towards y; `radius` is that of the discs, units of the page.
    """
    reach = HEADING_TICK * radius / canvas.page_length(1.0)
    for point, angle in zip(points, headings, strict=False):
        if angle is not None:
            turn = np.radians(angle)
            tip = point + reach * np.array([np.cos(turn), np.sin(turn)])
            canvas.cased([np.stack([point, tip])], WHITE, max(0.35 * radius, 1.5))


def number_robots(
    canvas: Canvas,
    points: Mapping[str, FloatArray],
    radius: float,
    labels: Labels,
    away: Mapping[str, FloatArray],
    flagged: Collection[str] = (),
) -> None:
    """Number the robots: in the disc where the number fits and no cross is, else beside it.

    More than 60 robots get no numbers. The discs are marked as occupied in any case.

    Args:
        canvas, points, radius, flagged: as for draw_robots.
        labels: the occupied parts of the page.
        away: preferred direction (2,) of each robot's number from its disc, by robot.
    """
    reach = 1.4 * radius * canvas.unit
    on_page = {robot: canvas.at(point[None])[0] for robot, point in points.items()}
    if on_page:
        centres = np.stack(list(on_page.values()))
        labels.take(np.concatenate([centres - reach, centres + reach], axis=1))
    if len(points) > NUMBERED:
        return
    for robot, centre in on_page.items():
        if radius >= NUMBER_RADIUS and robot not in flagged:
            canvas.text(centre, robot, 1.25 * radius, WHITE, ROBOT)
        else:
            size = canvas.text_size(robot, LABEL)
            where = labels.place(centre, size, away[robot], reach)
            canvas.text(where, robot, LABEL, WHITE, INK)


def draw_idle_robots(canvas: Canvas, points: Mapping[str, FloatArray], radius: float) -> None:
    """Draw grey discs where robots without a place in the plan stand."""
    for point in points.values():
        canvas.disc(point, radius, IDLE, float(np.clip(0.17 * radius, 0.6, 1.9)))


def draw_ways(canvas: Canvas, ways: Collection[FloatArray]) -> None:
    """Draw the ways, (k, 2) each, that robots are to drive, thinly, from a circle at each start.

    Those that hardly move have none; the more there are, the fainter they are.
    """
    reach = WAY_START / canvas.page_length(1.0)
    ways = [way for way in ways if np.linalg.norm(way - way[0], axis=1).max() > reach]
    faint = float(np.clip(NUMBERED / max(len(ways), 1), 0.25, 1.0))
    canvas.strokes(ways, INK, 2.6, 0.45 * faint)
    canvas.strokes(ways, WHITE, 1.1, 0.9 * faint)
    for way in ways if len(ways) <= NUMBERED else ():
        canvas.circle(way[0], WAY_START, WHITE, 1.0)


def outward_vectors(contract: Contract, site: Site, points: FloatArray) -> list[FloatArray]:
    """Return for each place the vector (2,) from its target's centre, px.

    It is zero for places that are not outside a target.
    """
    ways: list[FloatArray] = []
    for part in parts_of(contract, points, site):
        off = part.group.relation in OUTSIDE
        for point in part.points:
            way = point - np.asarray(part.outline.centre) if off else np.zeros(2)
            ways.append(way)
    return ways


def _guides(part: Part) -> list[FloatArray]:
    """Return the polylines to dash: straight across a cage's gaps, else the reference curve.

    Each is (k, 2), image pixels. Robots inside a target or placed freely have none.
    """
    if part.group.relation == "inside" or _is_free(part):
        return []
    curve = curve_of(part)
    if curve is None:
        return []
    if part.group.relation != "cage":
        return list(curve.lines)
    ordered = part.points[np.argsort(_feet_on_curve(part.points, curve), kind="stable")]
    return list(np.stack([ordered, np.roll(ordered, -1, axis=0)], axis=1))


def _is_free(part: Part) -> bool:
    shape = part.group.relation == "shape" and part.group.line is part.group.shape is None
    return shape or part.group.relation == "at"


def _widest_opening(part: Part) -> Opening | None:
    """Return a ring's widest gap, or None if the group is no ring or has fewer than two robots.

    In a cage, or a ring that has to leave an opening, it is the straight gap between robots' edges;
    in other rings that between their centres, measured along the curve.
    """
    if part.group.relation not in ("around", "cage") or len(part.points) < 2:
        return None
    curve = curve_of(part)
    if curve is None:
        return None
    stations = _feet_on_curve(part.points, curve)
    order = np.argsort(stations, kind="stable")
    points, after = part.points[order], np.roll(part.points[order], -1, axis=0)
    if part.group.relation == "cage" or part.group.opens:
        across = np.linalg.norm(after - points, axis=1)
        k = int(np.argmax(across))
        return Opening((points[k] + after[k]) / 2, max(float(across[k]) - 2 * part.radius, 0.0))
    return _gap_along(points, stations[order], curve)


def _gap_along(points: FloatArray, stations: FloatArray, curve: Curve) -> Opening | None:
    """Return the widest gap along a ring between robots in order, None if it is in pieces."""
    if len(curve.lines) != 1:
        return None
    cut = 0.0 if curve.closed else curve.cut(len(points))
    gaps = np.diff(stations)
    if cut is not None:
        gaps = np.append(gaps, stations[0] + curve.length + cut - stations[-1])
    k = int(np.argmax(gaps))
    line = LineString(curve.lines[0])
    station = np.array([(stations[k] + gaps[k] / 2) % (curve.length + (cut or 0.0))])
    middle = shapely.get_coordinates(shapely.line_interpolate_point(line, station))[0]
    return Opening(middle, float(gaps[k]))


def _feet_on_curve(points: FloatArray, curve: Curve) -> FloatArray:
    """Return the arc length of each point's foot on the curve, (n,), px."""
    feet = shapely.line_locate_point(curve.geometry(), shapely.points(points))
    return np.asarray(feet, dtype=float)


def _corner_links(part: Part, corners: FloatArray) -> list[FloatArray]:
    """Return a line (2, 2) from each robot to its corner, matched for the least total length."""
    from scipy.optimize import linear_sum_assignment

    distance = np.linalg.norm(part.points[:, None] - corners[None], axis=2)
    robots, matched = linear_sum_assignment(distance)
    return list(np.stack([part.points[robots], corners[matched]], axis=1))


def rings(geometry: BaseGeometry) -> list[FloatArray]:
    """Return the boundary lines of an area, each a closed line (k, 2)."""
    lines = shapely.get_parts(shapely.boundary(geometry))
    return [
        shapely.get_coordinates(x) for x in lines if isinstance(x, LineString | MultiLineString)
    ]
