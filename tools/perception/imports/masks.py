"""Reads a file of masks for a picture: each thing in it as one exact region in one piece.

Whatever does not fit the picture is refused in one sentence that says what would fit.
"""

import json
from collections.abc import Callable, Sequence
from typing import NamedTuple, NoReturn, TypeVar

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ...errors import InputError
from ...geometry.mending import mended
from ...geometry.outline import MIN_AREA, FloatArray, largest_part, outline_of
from ..contours import in_one_piece, outline_of_mask
from ..geotiff import Georeference
from ..image import Picture
from ..target_prompt import Mask
from .frames import BETTER, SURE, is_seen, likeliest_frame
from .rasters import label_image
from .shapes import Pixels, Shape, Size, refusal
from .vectors import json_shapes, yolo_shapes

MOST = 100
"""The most things that one file may hold."""
MOST_LABEL = 100
PNG = b"\x89PNG\r\n\x1a\n"
FIT = "give x, y in pixels of the picture as it is shown"


class Imported(NamedTuple):
    """A thing read from a file."""

    label: str
    mask: Mask


class _Found(NamedTuple):
    """A thing's region from the file's polygons and what was done to it, or its pixels."""

    label: str
    region: BaseGeometry
    done: str = ""
    pixels: Pixels | None = None


Thing = TypeVar("Thing", Shape, _Found)
Made = TypeVar("Made")


def masks_in(data: bytes, name: str, size: Size, picture: Picture | str) -> list[Imported]:
    """Read the things of a mask file for a picture, in the file's order.

    Args:
        data: the file's content.
        name: the file's name, for messages.
        size: width and height of the picture, px.
        picture: the picture, or its name alone; then outlines in another frame go unnoticed.

    Raises:
        InputError: the file cannot be read, is empty, or does not fit the picture.
    """
    known = picture if isinstance(picture, Picture) else None
    try:
        shapes = _shapes(data, size, picture if isinstance(picture, str) else picture.name)
        if not 1 <= len(shapes) <= MOST:
            held = f"it holds {len(shapes) or 'no'} things"
            raise refusal(held, f"1 to {MOST} can be pointed at together")
        found = _each(shapes, lambda shape: _read_shape(shape, size, known and known.place))
        note = "" if known is None else _frame_note(known, found)
        regions = _each(found, lambda thing: _region_seen(thing, size))
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    return [
        Imported(
            thing.label, Mask(rings=_rings(region), found_in=f"that of {name}{thing.done}{note}")
        )
        for thing, region in zip(found, regions, strict=True)
    ]


def _each(things: Sequence[Thing], work: Callable[[Thing], Made]) -> list[Made]:
    """Do the work on each thing; if there are several, an error says which one it is about."""
    made: list[Made] = []
    for number, thing in enumerate(things, start=1):
        try:
            made.append(work(thing))
        except InputError as error:
            label = f" ({thing.label[:MOST_LABEL]})" if thing.label else ""
            which = f"thing {number}{label}: " if len(things) > 1 else ""
            raise InputError(f"{which}{error}") from None
    return made


def _read_shape(shape: Shape, size: Size, place: Georeference | None) -> _Found:
    label = " ".join(shape.label.split())[:MOST_LABEL]
    if shape.pixels is not None:
        return _Found(label, Polygon(), "", shape.pixels)
    parts: list[BaseGeometry] = []
    notes: set[str] = set()
    for outer, *holes in (part for part in shape.rings if part):
        region, done = _simple_region(_in_pixels(outer, size, place))
        notes |= done
        for hole in holes:
            region = region.difference(_simple_region(_in_pixels(hole, size, place))[0])
        parts.append(region)
    return _Found(label, shapely.union_all(parts), "".join(f"; {note}" for note in sorted(notes)))


def _frame_note(picture: Picture, found: Sequence[_Found]) -> str:
    """Return a note if the polygons would fit another frame better, else an empty one.

    Raises:
        InputError: they surely would.
    """
    parts = [p for f in found if f.pixels is None and (p := largest_part(f.region))]
    rings = [shapely.get_coordinates(part.exterior) for part in parts]
    best, better = likeliest_frame(picture, rings) if rings else ("", 0.0)
    if better > SURE:
        raise refusal(f"its outlines follow no things here; they would fit {best}", FIT)
    return f"; its outlines would fit better {best}: look at them" if better > BETTER else ""


def _region_seen(thing: _Found, size: Size) -> Polygon:
    """Return the part of a thing's region inside the picture, in one piece.

    Raises:
        InputError: it lies outside the picture, is too small, or is in pieces.
    """
    if thing.pixels is not None:
        return outline_of_mask(thing.pixels()).polygon
    region = thing.region
    if region.area < MIN_AREA or not is_seen(region, np.asarray(size, dtype=float)):
        raise _placement_error(region)
    frame = shapely.box(-0.5, -0.5, size[0] - 0.5, size[1] - 0.5)
    return outline_of(in_one_piece(region.intersection(frame))).polygon


def _rings(region: Polygon) -> tuple[tuple[tuple[float, float], ...], ...]:
    rings = (shapely.get_coordinates(r)[:-1] for r in (region.exterior, *region.interiors))
    return tuple(tuple((float(x), float(y)) for x, y in ring) for ring in rings)


def _shapes(data: bytes, size: Size, picture: str) -> list[Shape]:
    if data.startswith(PNG):
        return label_image(data, size)
    try:
        text = data.decode("utf-8-sig")
        if not text.lstrip().startswith(("{", "[")):
            return yolo_shapes(text, size)
        return json_shapes(json.loads(text, parse_constant=_no_number), size, picture)
    except InputError:
        raise
    except (ValueError, RecursionError, TypeError, IndexError):
        raise refusal("it is damaged", "export it again") from None


def _no_number(text: str) -> NoReturn:
    raise refusal(f"it holds {text}, which is no place", "export it again")


def _placement_error(region: BaseGeometry) -> InputError:
    """Return the error for a region that lies outside the picture or is too small."""
    if region.is_empty:
        return refusal("it has no polygon", "draw one around it")
    places = shapely.get_coordinates(region) + 0.5
    x, y = np.abs(places).max(axis=0)
    if region.area < MIN_AREA and max(x, y) <= 1:
        return refusal("its numbers are from 0 to 1", FIT)
    if x <= 180 and y <= 90 and region.area < MIN_AREA and (places % 1).any():
        return refusal(
            "its numbers are longitudes and latitudes", f"{FIT}, or a GeoTIFF of that place"
        )
    if region.area < MIN_AREA:
        return refusal("an outline in it encloses less than 4 square px", "draw it again")
    return refusal("an outline in it lies outside the picture", FIT)


def _in_pixels(ring: FloatArray, size: Size, place: Georeference | None) -> FloatArray:
    """Convert a ring to pixels with centres at integers.

    If it makes sense as places on the picture's map, it is converted from these.
    """
    if place is not None:
        mapped = place.to_pixels(ring)
        if ((mapped.max(axis=0) > 0) & (mapped.min(axis=0) < size)).all():
            return mapped
    return ring - 0.5


def _simple_region(ring: FloatArray) -> tuple[BaseGeometry, set[str]]:
    region = Polygon(ring)
    if region.is_valid or region.convex_hull.area < MIN_AREA:
        return region if region.is_valid else region.convex_hull, set()
    made = mended([(float(x), float(y)) for x, y in ring])
    if made is None:
        raise refusal("an outline in it crosses itself", "give its vertices in order")
    return made[0], {made[1]}
