"""The families of scenes: which things there are, in which colours, on which ground.

They are listed in families.yaml; this module replaces names by the functions that draw them.
"""

from pathlib import Path
from typing import Any

import yaml
from numpy.random import Generator
from shapely.geometry import Polygon

from . import ground, indoors, outdoors, polygons
from .drawing import Draw, plain
from .things import Family, Sort


def _drawing(name: str, *sizes: float | list[float]) -> Draw:
    """Return a drawing by its name, or one that draws an outline by its name and sizes."""
    for room in (indoors, outdoors):
        if name in vars(room):
            return getattr(room, name)

    def outline(random: Generator) -> Polygon:
        drawn = [random.uniform(s[0], s[1]) if isinstance(s, list) else s for s in sizes]
        return getattr(polygons, name)(*drawn)

    return plain(outline)


def _sort(noun: str, *, draw: list[Any] | None = None, **facts: Any) -> Sort:
    return Sort(noun, draw=_drawing(*(draw or [noun])), **facts)


def _family(name: str, *, sorts: dict[str, dict[str, Any]], **facts: Any) -> Family:
    made = tuple(_sort(noun, **given) for noun, given in sorts.items())
    return Family(name, made, **facts | {"ground": getattr(ground, facts["ground"])})


_GIVEN = yaml.safe_load((Path(__file__).parent / "families.yaml").read_text(encoding="utf-8"))
FAMILIES = tuple(_family(name, **facts) for name, facts in _GIVEN.items())
