"""Draws numbered candidates, each outlined in a colour that differs from its neighbours'.

A person must be able to answer "the third": a number stands inside its object where most of the
object stays visible, else beside it.
"""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..geometry.outline import FloatArray, Outline, largest_part
from ..geometry.sampling import nearest
from ..perception.referring.attributes import Candidate
from .canvas import INK, MARKS, Canvas, Colour, Labels
from .marks import OUTLINE_DETAIL, rings

FEW, LARGE, USUAL, LEAST = 12, 23.0, 17.0, 12.0
"""Up to FEW numbers are LARGE, units; more are USUAL, or smaller in a crowd, but at least LEAST."""
PITCH_SHARE = 0.35
"""Size of the numbers in a crowd, as a share of the distance between neighbouring objects."""
LINE, SEAM = 2.4, 1.4
INSET = 3.0
"""Width of the margin around a number within which its object stays visible, units."""
COVERED = 0.3
"""Greatest share of an object that its number may cover."""
WAYS = 24
"""Number of directions tried when placing a number beside an object."""
GAP = 3.0
"""Distance from an object to a number beside it, units."""


def colours_of(outlines: Sequence[Outline]) -> list[Colour]:
    """Choose a colour for each outline, the one that is least used nearby."""
    edges = [o.polygon.simplify(1.0).boundary for o in outlines]
    chosen: list[int] = []
    for edge in edges:
        met = np.zeros(len(MARKS))
        for colour, other in zip(chosen, edges, strict=False):
            met[colour] += 1 / (1 + edge.distance(other))
        chosen.append(int(np.argmin(met)))
    return [MARKS[c] for c in chosen]


def draw_numbered(
    canvas: Canvas, candidates: Sequence[Candidate], colours: Sequence[Colour], labels: Labels
) -> None:
    """Draw the candidates' outlines with their holes, and their numbers: 3 for c3."""
    _draw_outlines(canvas, candidates, colours)
    text = _text_size(canvas, candidates)
    names = [c.id.removeprefix("c") for c in candidates]
    sizes = [np.array(canvas.chip_size(name, text)) for name in names]
    things = [_on_page(canvas, c.outline) for c in candidates]
    places = [
        _place_in(thing, things, size, INSET * canvas.unit)
        for thing, size in zip(things, sizes, strict=True)
    ]
    for place, size in zip(places, sizes, strict=True):
        if place is not None:
            labels.take(np.concatenate([place - size / 2, place + size / 2])[None])
    for k, place in enumerate(places):
        if place is None:
            place = _place_beside(canvas, things[k], things, sizes[k], labels)
        canvas.chip(place, names[k], text, INK, colours[k], SEAM)


def _text_size(canvas: Canvas, candidates: Sequence[Candidate]) -> float:
    if len(candidates) <= FEW:
        return LARGE
    centres = np.array([c.attributes.centre for c in candidates])
    pitch = float(np.median(nearest(centres, centres, 2)[0][:, 1]))
    return float(np.clip(PITCH_SHARE * canvas.page_length(pitch), LEAST, USUAL))


def _draw_outlines(
    canvas: Canvas, candidates: Sequence[Candidate], colours: Sequence[Colour]
) -> None:
    """Draw the outlines: all seams below all lines, and small objects above large ones."""
    detail = OUTLINE_DETAIL / canvas.page_length(1.0)
    largest = sorted(zip(candidates, colours, strict=True), key=lambda c: -c[0].outline.area)
    lines = [(rings(c.outline.polygon.simplify(detail)), colour) for c, colour in largest]
    canvas.strokes([line for found, _ in lines for line in found], INK, LINE + 2 * SEAM, 0.75)
    for found, colour in lines:
        canvas.strokes(found, colour, LINE)


def _on_page(canvas: Canvas, outline: Outline) -> BaseGeometry:
    """Return the outline in page px, simplified as far as placing a number allows."""
    placed = shapely.transform(outline.polygon, canvas.at)
    return shapely.make_valid(placed.simplify(canvas.unit))


def _place_in(
    thing: BaseGeometry, things: Sequence[BaseGeometry], size: FloatArray, inset: float
) -> FloatArray | None:
    """Return the centre (2,) of a place for a number inside an object, page px.

    It keeps clear of smaller objects on this one. None if there is no such place.
    """
    if float(np.prod(size)) > COVERED * thing.area:
        return None
    smaller = [t for t in things if t.area < thing.area and t.intersects(thing)]
    free = largest_part(thing.difference(shapely.union_all(smaller)))
    if free is None:
        return None
    deepest = shapely.get_coordinates(shapely.maximum_inscribed_circle(free))[0]
    for middle in (shapely.get_coordinates(thing.centroid)[0], deepest):
        if free.contains(_box_about(middle, size / 2 + inset)):
            return middle
    return None


def _place_beside(
    canvas: Canvas,
    thing: BaseGeometry,
    things: Sequence[BaseGeometry],
    size: FloatArray,
    labels: Labels,
) -> FloatArray:
    """Return the centre (2,) of the place beside an object where a number hides least, page px."""
    turns = -np.pi / 4 + np.arange(WAYS) * 2 * np.pi / WAYS
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    rim = shapely.get_coordinates(thing)
    feet = rim[np.argmax(rim @ ways.T, axis=0)]
    centres = feet + ways * (GAP * canvas.unit + np.abs(ways) @ size / 2)[:, None]
    boxes = [_box_about(centre, size / 2) for centre in centres]
    hidden = [sum(box.intersection(t).area for t in things if box.intersects(t)) for box in boxes]
    return labels.pick(centres, size, np.array(hidden))


def _box_about(middle: FloatArray, half: FloatArray) -> Polygon:
    (x0, y0), (x1, y1) = (middle - half).tolist(), (middle + half).tolist()
    return Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
