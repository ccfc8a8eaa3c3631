"""Tools that measure: describe_shape, check_point, measure."""

import math
from typing import Any

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry import Point as Place
from shapely.geometry.base import BaseGeometry

from ..context import Context, Descriptor
from ..errors import ToolError
from ..formation.units import with_metres
from ..geometry.outline import FloatArray, Outline, distances
from ..perception.target_prompt import Point
from ..tool import ToolResult, tool
from .seeing import framed
from .standing import PLAN, robot_data, robot_named, standing_data
from .targets import measured_all, with_pointed

MATRIX_SIDE = 32
"""Longest side of the binary matrix descriptor, cells."""
ON_EDGE = 0.5
"""Nearer to the outline than this, px, a point is on the edge."""


@tool("read")
def describe_shape(
    context: Context, target: str, descriptor: Descriptor | None = None
) -> ToolResult:
    """Describe a target's outline: numbered edges, size, axes, corners, holes.

    Args:
        target: its id.
        descriptor: edges by default.
    """
    outline = context.world.target(target).outline
    unit, length, width = outline.long_axis
    data: dict[str, Any] = {
        "target": target,
        "kind": outline.kind,
        "kind_confidence": round(outline.kind_confidence, 2),
        "area_px": round(outline.area),
        "perimeter_px": round(outline.perimeter, 1),
        "length_px": round(length, 1),
        "width_px": round(width, 1),
        "min_width_px": round(outline.min_width, 1),
        "long_axis_degrees": round(math.degrees(math.atan2(unit[1], unit[0])), 1),
        "centre": _rounded(outline.centre),
        "corners": [_rounded(c) for c in outline.corners],
        "holes": len(outline.polygon.interiors),
        **framed(context.world),
    }
    data = with_metres(data, context.world.metres_per_pixel)
    return ToolResult(data | _described(outline, descriptor or context.settings.descriptor))


@tool("read")
def check_point(context: Context, target: str, points: tuple[Point, ...]) -> ToolResult:
    """Say of each point whether it is inside, outside or on the edge of a target, and how far.

    Args:
        target: its id.
        points: (x, y) of each.
    """
    outline = context.world.target(target).outline
    places = np.asarray(points, dtype=float).reshape(-1, 2)
    vertices, edges = outline.graph()
    sides = [LineString(vertices[list(edge)]) for edge in edges]
    nearest = np.argmin(np.stack([distances(side, places) for side in sides]), axis=0)
    inside = shapely.intersects_xy(outline.polygon, places)
    depth = distances(outline.polygon.boundary, places)
    scale = context.world.metres_per_pixel
    rows = [
        with_metres(
            {
                "point": _rounded(p),
                "where": "on edge" if d <= ON_EDGE else "inside" if i else "outside",
                "signed_distance_px": round(float(-d if i else d), 2),
                "nearest_edge": int(e),
            },
            scale,
        )
        for p, i, d, e in zip(places, inside, depth, nearest, strict=True)
    ]
    return ToolResult({"target": target, "points": rows, **framed(context.world)})


@tool("read")
def measure(context: Context, a: str | Point, b: str | Point | None = None) -> ToolResult:
    """Measure distances and direction from a to b; or the plan: places, distances, openings.

    Args:
        a: id, (x, y) or r3 for robot 3; plan or r3, alone.
        b: likewise.
    """
    if a == PLAN:
        return ToolResult(standing_data(context))
    if b is None and isinstance(a, str) and a[:1] == "r":
        robot_named(context.world, a)
        return ToolResult(robot_data(context, a))
    if b is None:
        raise ToolError("measure: b is missing; only the plan and robots are measured alone.")
    named = {n for n in (a, b) if isinstance(n, str)}
    world = measured_all(context, with_pointed(context.world, (), named))
    context = context.at(world)
    (shape_a, centre_a), (shape_b, centre_b) = _place(context, a), _place(context, b)
    way = centre_b - centre_a
    data = {
        "nearest_px": round(float(shape_a.distance(shape_b)), 2),
        "centres_px": round(float(np.hypot(*way)), 2),
        "direction_degrees": round(math.degrees(math.atan2(way[1], way[0])), 1),
        **framed(context.world, "; directions clockwise from right"),
    }
    return ToolResult(with_metres(data, world.metres_per_pixel), world=world)


def _place(context: Context, thing: str | Point) -> tuple[BaseGeometry, FloatArray]:
    if isinstance(thing, str) and thing[:1] == "r":
        thing = robot_named(context.world, thing)
    if isinstance(thing, str):
        outline = context.world.target(thing).outline
        return outline.polygon, np.asarray(outline.centre)
    return Place(thing), np.asarray(thing, dtype=float)


def _described(outline: Outline, descriptor: Descriptor) -> dict[str, Any]:
    vertices, edges = outline.graph()
    if descriptor == "matrix":
        return {"matrix": _matrix(outline)}
    lines = [[*_rounded(vertices[i]), *_rounded(vertices[j])] for i, j in edges]
    described: dict[str, Any] = {"edges": dict(enumerate(lines))}
    if descriptor == "edges+vertices":
        described["vertices"] = dict(enumerate(_rounded(v) for v in vertices))
    return described


def _matrix(outline: Outline) -> dict[str, Any]:
    """Return the region as rows of 0 and 1, with the cell size that maps it back to pixels."""
    x0, y0, x1, y1 = outline.bounds
    cell = max(x1 - x0, y1 - y0) / MATRIX_SIDE
    columns, rows = max(round((x1 - x0) / cell), 1), max(round((y1 - y0) / cell), 1)
    x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    inside = shapely.contains_xy(outline.polygon, x0 + x * cell, y0 + y * cell)
    return {
        "origin": _rounded((x0, y0)),
        "cell_px": round(cell, 3),
        "rows": ["".join("1" if v else "0" for v in row) for row in inside],
    }


def _rounded(point: Any) -> list[float]:
    return [round(float(v), 1) for v in point]
