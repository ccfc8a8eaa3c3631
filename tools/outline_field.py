"""Outlines as JSON and back, for files, logs and replies."""

from typing import Annotated, Any

from pydantic import PlainSerializer, PlainValidator
from shapely.errors import ShapelyError
from shapely.geometry import Polygon

from .errors import InputError
from .geometry.outline import Outline, outline_of


def outline_rings(outline: Outline) -> dict[str, Any]:
    """Return an outline as JSON: the ring around it and those around its holes, (x, y) px."""
    polygon = outline.polygon
    rings = [list(ring.coords[:-1]) for ring in (polygon.exterior, *polygon.interiors)]
    return {"outline": rings[0]} | ({"holes": rings[1:]} if rings[1:] else {})


def rounded_rings(outline: Outline) -> tuple[list[Any], list[Any]]:
    """Return the ring around an outline and those around its holes, rounded to 0.001 px."""
    rings = outline_rings(outline)
    rounded = [
        [[round(x, 3), round(y, 3)] for x, y in ring]
        for ring in (rings["outline"], *rings.get("holes", ()))
    ]
    return rounded[0], rounded[1:]


def _read_outline(value: Any) -> Outline:
    """Return an outline as it is, or read what `outline_rings` wrote, with exactly its rings."""
    if isinstance(value, Outline):
        return value
    try:
        if unknown := set(value) - {"outline", "holes"}:
            raise ValueError(f"it has {min(unknown)!r}, which no outline has")
        polygon = Polygon(value["outline"], value.get("holes", ()))
        if not polygon.is_valid:
            raise ValueError("its rings cross, or are not finite")
        return outline_of(polygon)
    except (AttributeError, KeyError, TypeError, ValueError, InputError, ShapelyError) as error:
        raise ValueError(f"is no outline: {error}") from None


OutlineField = Annotated[
    Outline, PlainValidator(_read_outline), PlainSerializer(outline_rings, when_used="json")
]
