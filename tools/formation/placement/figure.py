"""Positions a drawn shape and the robots on it, for both placement and checking.

Size and place follow from the contract and the site alone. Frame: image pixels, y down.
"""

import math
from collections.abc import Callable

import numpy as np
import shapely
from shapely.geometry import (
    GeometryCollection,
    LineString,
    MultiLineString,
    MultiPoint,
    Point,
    Polygon,
)

from ...errors import InputError, ToolError
from ...geometry.curves import QUAD_SEGMENTS, ROUND_JOIN_DIP
from ...geometry.figures.letters import letter_strokes
from ...geometry.figures.shapes import (
    Sketch,
    arc_sketch,
    cup_sketch,
    fitted,
    grid_sketch,
    line_sketch,
    polygon_sketch,
    polyline_sketch,
    star_sketch,
)
from ...geometry.figures.strokes import spread
from ...geometry.figures.typeface import letter_outlines
from ...geometry.outline import FloatArray, Outline
from ...geometry.sampling import min_spacing
from ..contract import Group, ShapeSpec, nominal
from ..site import CapacityError, Site, most_that_fit

STAR_TIPS, POLYGON_CORNERS = 5, 6
HALF_CIRCLE = {"up": (0, 180), "right": (90, 270), "down": (180, 360), "left": (-90, 90)}
BESIDE = {"left": (-1, 0), "right": (1, 0), "above": (0, -1), "below": (0, 1)}
ROOMY = 1.02
"""Factor by which a shape too small for the spacing is made larger than needed."""
SEARCH = 40
"""Most steps of the search for a size or a place."""
SHRINKS = 0.95 ** np.arange(90)
"""Sizes tried inside a target, as shares of the largest conceivable one, down to a hundredth."""


def figure_of(group: Group, shape: ShapeSpec, site: Site, radius: float) -> Sketch:
    """Return the shape that a group draws, in its place; the group's defaults are filled in.

    Raises:
        ToolError: there is no room for it.
    """
    sketch = _sketch(group, shape)
    try:
        placed = _figure_placed(sketch, group, shape, site, radius)
    except InputError as error:
        raise ToolError(str(error)) from None
    points = placed.points
    box = site.frame(radius).box.buffer(1e-6)
    if not shapely.intersects_xy(box, points).all():
        (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
        raise ToolError(
            f"The {shape.name} would reach from ({x0:.0f}, {y0:.0f}) to ({x1:.0f}, {y1:.0f}), out "
            f"of the {site.length(site.room, 'g', ' x ')} picture: place it elsewhere or smaller."
        )
    return placed


def place_figure(group: Group, shape: ShapeSpec, site: Site, radius: float) -> FloatArray:
    """Place a group's robots on its shape, (n, 2), image pixels.

    Raises:
        CapacityError: they would stand nearer to each other than allowed.
        ToolError: see `figure_of`.
    """
    figure = figure_of(group, shape, site, radius)
    spacing = group.min_spacing or 0.0
    points = robots_on(figure, group.robots)
    if min_spacing(points) >= spacing * (1 - 1e-6):
        return points

    def apart(n: int) -> bool:
        fewer = group.model_copy(update={"robots": n})
        drawn = robots_on(figure_of(fewer, shape, site, radius), n)
        return min_spacing(drawn) >= spacing * (1 - 1e-6)

    few, many = 1, group.robots
    while many - few > 1:
        middle = (few + many) // 2
        few, many = (middle, many) if apart(middle) else (few, middle)
    fits = most_that_fit(apart, few, group.robots)
    size = site.length(figure.size, ".0f", " x ")
    why = f"no more stand {site.length(spacing, 'g')} apart on the {shape.name}, {size}"
    raise CapacityError(group, fits, why)


def robots_on(figure: Sketch, n: int) -> FloatArray:
    """Spread n robots over a shape, (n, 2), image pixels."""
    return spread(figure.lines, n) if figure.places is None else figure.places


def drawn_by(figure: Sketch) -> MultiLineString | MultiPoint:
    """Return the geometry of a shape: its lines, or the places of a grid."""
    return MultiLineString(figure.lines) if figure.places is None else MultiPoint(figure.places)


def _sketch(group: Group, shape: ShapeSpec) -> Sketch:
    n, box = group.robots, shape.box
    if shape.points is not None:
        return polyline_sketch(np.asarray(shape.points, dtype=float))
    upright = shape.where in ("left", "right")
    if box is not None:
        upright = box[3] - box[1] > box[2] - box[0]
    rows = shape.rows or _rows(n, box)
    made: dict[str, Callable[[], Sketch]] = {
        "line": lambda: line_sketch(upright),
        "arc": lambda: arc_sketch(*(shape.angles or HALF_CIRCLE[shape.mouth or "up"])),
        "v": lambda: cup_sketch("v", shape.mouth or "up"),
        "u": lambda: cup_sketch("u", shape.mouth or "up"),
        "circle": arc_sketch,
        "grid": lambda: grid_sketch(n, min(rows, n)),
        "polygon": lambda: polygon_sketch(shape.corners or POLYGON_CORNERS),
        "star": lambda: star_sketch(shape.corners or STAR_TIPS),
        "letters": lambda: polyline_sketch(*letter_strokes(shape.text or "")),
        "outlined_letters": lambda: polyline_sketch(*letter_outlines(shape.text or "")),
    }
    if shape.kind == "arc" and shape.mouth is not None and shape.where != "around":
        return cup_sketch("arc", shape.mouth)  # placed by the arc itself, not by its whole circle
    return made[shape.kind]()


def _rows(n: int, box: tuple[float, float, float, float] | None) -> int:
    """Return the number of rows that makes the grid's cells as square as possible."""
    tall = 1.0 if box is None else (box[3] - box[1]) / max(box[2] - box[0], 1e-9)
    return min(max(round(math.sqrt(n * tall)), 1), n)


def _figure_placed(
    sketch: Sketch, group: Group, shape: ShapeSpec, site: Site, radius: float
) -> Sketch:
    if shape.box is not None:
        return fitted(sketch, shape.box)
    if shape.where is None:
        return sketch
    outline = site.outlines[group.targets[0]]
    if shape.where == "on":
        return fitted(sketch, outline.bounds)
    if shape.where == "inside":
        return _figure_inside(sketch, group, site, group.offsets(radius)[0])
    gap = nominal(group.offsets()) + radius
    if shape.where == "around":
        return _figure_around(sketch, outline, gap, shape)
    return _figure_beside(sketch, group, site, shape.where, gap, radius)


def _figure_inside(sketch: Sketch, group: Group, site: Site, margin: float) -> Sketch:
    """Return the sketch as large as fits inside the target, off its holes, about a centre of it.

    With a pitch, the size follows from that.
    """
    outline = site.visible(group.targets[0])
    room = outline.polygon.buffer(-margin * ROUND_JOIN_DIP, quad_segs=QUAD_SEGMENTS)
    x0, y0, x1, y1 = outline.bounds
    width, height = sketch.size
    most = math.hypot(x1 - x0, y1 - y0) / (max(width, height) or 1.0)
    middle = outline.filled.centroid
    centres = (outline.centre, (middle.x, middle.y), ((x0 + x1) / 2, (y0 + y1) / 2))
    for scale in most * SHRINKS if group.pitch is None else (_pitch_scale(sketch, group),):
        for centre in centres:
            placed = sketch.at(centre, float(scale))
            lines = [LineString(line) for line in placed.lines]
            if room.covers(GeometryCollection([*lines, MultiPoint(placed.points)])):
                return placed
    raise ToolError(f"It has no room inside the target, {site.length(margin)} from its edge.")


def _figure_around(sketch: Sketch, outline: Outline, gap: float, shape: ShapeSpec) -> Sketch:
    """Return the smallest sketch that encloses the outline at a distance of `gap`.

    An arc counts as its whole circle.
    """
    circle = shapely.minimum_bounding_circle(outline.filled)
    centre = (float(circle.centroid.x), float(circle.centroid.y))

    def holds(scale: float) -> bool:
        placed = sketch.at(centre, scale)
        line = LineString(placed.lines[0])
        arc = shape.kind == "arc"
        whole = Point(centre).buffer(placed.size[0] / 2) if arc else Polygon(line)
        return whole.contains(outline.filled) and line.distance(outline.filled) >= gap

    low, high = 0.0, 1.0
    while not holds(high):
        low, high = high, high * 2
        if high > 1e6:
            raise ToolError("The shape cannot go around the target.")
    for _ in range(SEARCH):
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return sketch.at(centre, high)


def _pitch_scale(sketch: Sketch, group: Group) -> float:
    """Return the scale at which robots on a shape stand their pitch apart."""
    apart = min_spacing(robots_on(sketch, group.robots))
    return (group.pitch or 0.0) / apart if 0 < apart < math.inf else 1.0


def _figure_beside(
    sketch: Sketch, group: Group, site: Site, where: str, gap: float, radius: float
) -> Sketch:
    """Return the sketch beside the target, inside the picture.

    It is as high (left, right) or as wide (above, below) as the target, or larger if the spacing
    needs it; with a pitch, its size follows from that.
    """
    dx, dy = BESIDE[where]
    x0, y0, x1, y1 = site.outlines[group.targets[0]].bounds
    free = site.frame(radius).box
    if free.is_empty:
        raise ToolError("The robots are too large for the picture.")
    left, top, right, bottom = free.bounds
    wide = (x0 - gap - left) if dx < 0 else (right - x1 - gap) if dx > 0 else right - left
    high = (y0 - gap - top) if dy < 0 else (bottom - y1 - gap) if dy > 0 else bottom - top
    width, height = sketch.size
    most = min(wide / width if width else math.inf, high / height if height else math.inf)
    if min(wide, high, most) <= 0:
        place = f"{where} of" if where in ("left", "right") else where
        text = f"There is no room {place} {group.targets[0]} in the picture."
        raise ToolError(text, "no_room_beside")
    extent = (y1 - y0) / height if dx and height else (x1 - x0) / width if dy and width else most
    scale = min(extent, most) if width or height else 1.0
    apart = min_spacing(robots_on(sketch, group.robots)) * scale
    if group.pitch is not None:
        scale = min(most, _pitch_scale(sketch, group))  # the checker reports a smaller one
    elif apart < (group.min_spacing or 0.0):
        scale = min(most, ROOMY * scale * (group.min_spacing or 0.0) / max(apart, 1e-9))
    half_x, half_y = scale * width / 2, scale * height / 2
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    x = x0 - gap - half_x if dx < 0 else x1 + gap + half_x if dx > 0 else x
    y = y0 - gap - half_y if dy < 0 else y1 + gap + half_y if dy > 0 else y
    x = min(max(x, left + half_x), right - half_x)
    y = min(max(y, top + half_y), bottom - half_y)
    return _brought_near(sketch, group, site, (x, y, scale), (dx, dy), radius)


def _brought_near(
    sketch: Sketch,
    group: Group,
    site: Site,
    place: tuple[float, float, float],
    beside: tuple[int, int],
    radius: float,
) -> Sketch:
    """Move a sketch from beside the target's box to no further from its outline than allowed."""
    x, y, scale = place
    solid, gap = site.outlines[group.targets[0]].filled, nominal(group.offsets()) + radius
    placed = sketch.at((x, y), scale)
    for _ in range(SEARCH):  # no step is longer than the free distance
        off = drawn_by(placed).distance(solid)
        if off <= group.offsets(radius)[1]:
            break
        x, y = x - beside[0] * (off - gap), y - beside[1] * (off - gap)
        placed = sketch.at((x, y), scale)
    return placed
