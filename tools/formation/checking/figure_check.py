"""Checks that robots draw the shape a contract names: on its lines, none of them bare or crowded.

The reference is the placement that `figure` itself would make on the same lines.
"""

from shapely.geometry import LineString, MultiLineString

from ...geometry.figures.shapes import Sketch
from ...geometry.figures.strokes import stretches
from ...geometry.outline import FloatArray
from ...geometry.sampling import min_spacing, nearest
from ..placement.figure import robots_on
from ..placement.spacing import NARROWEST, WIDEST, on_curve
from .verdict import TOLERANCE, Audit, Part

LINE_SHARE = 0.03
"""How far off a shape's lines a robot may stand, as a share of its shorter side."""
GRID_SHARE = 0.25
"""How far off its place in a grid a robot may stand, as a share of the grid's pitch."""
LEAST_REACH = 2.0
"""A robot within this distance, px, stands on the line, whatever the shape's size."""


def on_figure(part: Part, figure: Sketch, audit: Audit) -> None:
    """Check robots against the lines, or the grid places, of a shape."""
    ideal = robots_on(figure, part.group.robots)
    apart = min_spacing(ideal)
    if figure.places is not None:
        _in_grid(part, figure.places, apart, audit)
        return
    width, height = figure.size
    share = LINE_SHARE * (min(width, height) or max(width, height))
    reach = max(min(share, apart / 2), LEAST_REACH)
    lines = MultiLineString([LineString(line) for line in figure.lines])
    assert part.group.shape is not None
    on_curve(part, lines, reach, f"the {part.group.shape.name}", audit)
    if part.group.spacing == "free":
        return
    allowed = WIDEST * max(s.length for s in stretches(figure.lines, ideal, LEAST_REACH))
    found = stretches(figure.lines, part.points, reach + TOLERANCE)
    audit.greatest("worst_gap_px", max(s.length for s in found))
    for bare in (s for s in found if s.length > allowed + TOLERANCE):
        if bare.robot is None:
            audit.find("bare_stretch", bare.length, allowed)
        else:
            audit.find("bare_end", bare.length, allowed, robot=part.first + bare.robot)
    if len(part.points) > 1:
        closest = min_spacing(part.points)
        audit.least("spacing_ratio", closest / apart)
        if closest < NARROWEST * apart - TOLERANCE:
            audit.find("crowded_figure", closest, NARROWEST * apart)


def _in_grid(part: Part, places: FloatArray, pitch: float, audit: Audit) -> None:
    """Check that every robot is near a place of its own."""
    reach = max(GRID_SHARE * pitch, LEAST_REACH) if len(places) > 1 else LEAST_REACH
    distance, place = nearest(places, part.points, 1)
    audit.greatest("max_from_place_px", distance.max())
    taken: dict[int, int] = {}
    for i, (away, k) in enumerate(zip(distance, place, strict=True), start=part.first):
        x, y = places[k]
        at = f"({x:.0f}, {y:.0f})"
        if away > reach + TOLERANCE:
            about = f"{at}, the nearest place of the grid"
            audit.find("off_grid", away, reach, robot=i, about=about)
        elif int(k) in taken:
            audit.find("same_place", away, reach, robot=i, others=(taken[int(k)],), about=at)
        taken.setdefault(int(k), i)
