"""Reads masks stored as polygons: COCO, LabelMe, GeoJSON and YOLO, as these programs write them."""

from collections.abc import Mapping
from functools import partial
from pathlib import PurePath
from typing import Any

import numpy as np

from ...geometry.outline import FloatArray
from .rasters import run_lengths
from .shapes import Shape, Size, check_size, fields, items, refusal, ring_of

ROUND = 64
"""Number of vertices that a circle is given."""


def json_shapes(content: Any, size: Size, picture: str) -> list[Shape]:
    """Read the things of a JSON file of any of these programs.

    Args:
        content: the file's decoded JSON.
        size: width and height of the picture, px.
        picture: the picture's name, for files about several pictures.

    Raises:
        InputError: the file's format is unknown, or it is about another picture.
    """
    whole = fields(content)
    if "shapes" in whole:
        return _labelme(whole, size)
    if "counts" in whole:
        return [Shape("", partial(run_lengths, whole, size))]
    results = items(content) or ([whole] if "segmentation" in whole else [])
    if results and all("segmentation" in fields(result) for result in results):
        return _coco({"annotations": results}, size, picture)
    if "annotations" in whole:
        return _coco(whole, size, picture)
    if "type" in whole:
        return _geojson(whole)
    raise refusal(
        "it is none of the mask files that can be read",
        "give a PNG, COCO, LabelMe or GeoJSON as JSON, or YOLO polygons as .txt",
    )


def _coco(whole: Mapping[str, Any], size: Size, picture: str) -> list[Shape]:
    images = [fields(i) for i in items(whole.get("images"))]
    named = [i for i in images if PurePath(str(i.get("file_name", ""))).name == picture]
    about = named[:1] or images[:1]
    annotations = [fields(a) for a in items(whole.get("annotations"))]
    if (len(images) > 1 and not named) or len({a.get("image_id") for a in annotations}) > 1 > len(
        images
    ):
        raise refusal(
            f"it is about several pictures, and none is called {picture}",
            "name the picture as the file does, or leave the others out",
        )
    for image in about:
        check_size((image.get("width"), image.get("height")), size)
        annotations = [a for a in annotations if a.get("image_id") == image.get("id")]
    names = {
        fields(c).get("id"): str(fields(c).get("name", "")) for c in items(whole.get("categories"))
    }
    return [
        _segmentation(names.get(a.get("category_id"), ""), a.get("segmentation"), size)
        for a in annotations
    ]


def _segmentation(label: str, found: Any, size: Size) -> Shape:
    if isinstance(found, dict):
        return Shape(label, partial(run_lengths, found, size))
    return Shape(label, rings=[[ring_of(part)] for part in items(found)])


def _labelme(whole: Mapping[str, Any], size: Size) -> list[Shape]:
    check_size((whole.get("imageWidth"), whole.get("imageHeight")), size)
    found: list[Shape] = []
    for shape in map(fields, items(whole["shapes"])):
        kind, points = shape.get("shape_type", "polygon"), items(shape.get("points"))
        if kind in ("rectangle", "circle") and len(points) == 2:
            (x0, y0), (x1, y1) = ring_of([*points, points[0]])[:2]
            ring = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
            if kind == "circle":
                turns = np.linspace(0, 2 * np.pi, ROUND, endpoint=False)
                circle = np.column_stack([np.cos(turns), np.sin(turns)])
                ring = (x0, y0) + np.hypot(x1 - x0, y1 - y0) * circle
        elif kind in ("polygon", "rectangle"):
            ring = ring_of(points)
        else:
            raise refusal(
                f"a shape in it is a {str(kind)[:40]!r}",
                "draw it as a polygon, rectangle or circle",
            )
        found.append(Shape(str(shape.get("label") or ""), rings=[[ring]]))
    return found


def _geojson(whole: Mapping[str, Any]) -> list[Shape]:
    features = items(whole.get("features")) if whole["type"] == "FeatureCollection" else [whole]
    found: list[Shape] = []
    for feature in map(fields, features):
        geometry = fields(feature.get("geometry")) if feature.get("type") == "Feature" else feature
        kind, parts = geometry.get("type"), items(geometry.get("coordinates"))
        if kind not in ("Polygon", "MultiPolygon"):
            raise refusal(
                f"a geometry in it is a {str(kind)[:40]!r}", "give polygons or multipolygons"
            )
        properties = fields(feature.get("properties"))
        label = next((properties[k] for k in ("name", "label", "class") if properties.get(k)), "")
        polygons = [parts] if kind == "Polygon" else parts
        rings = [[_flat(ring) for ring in items(polygon)] for polygon in polygons]
        found.append(Shape(str(label), rings=rings))
    return found


def _flat(ring: Any) -> FloatArray:
    """Return a GeoJSON ring (n, 2) without its heights."""
    return ring_of([items(place)[:2] for place in items(ring)])


def yolo_shapes(text: str, size: Size) -> list[Shape]:
    """Read the things of a YOLO file: a line each, with a class and x, y from 0 to 1.

    Raises:
        InputError: the file holds something else, such as boxes or pixels.
    """
    found: list[Shape] = []
    for line in filter(None, map(str.split, text.splitlines())):
        try:
            name, values = int(line[0]), [float(v) for v in line[1:]]
        except ValueError:
            raise refusal(
                "it is none of the mask files that can be read",
                "give a PNG, COCO, LabelMe or GeoJSON as JSON, or YOLO polygons as .txt",
            ) from None
        if len(values) == 4 or len(values) % 2:
            raise refusal(
                f"a line in it has {len(values)} numbers behind the class, as a box has",
                "give polygons of 3 or more x, y from 0 to 1, or point with a box",
            )
        ring: FloatArray = ring_of(values)
        if ring.min() < 0 or ring.max() > 1:
            raise refusal(
                "its numbers are not from 0 to 1, as YOLO's are",
                "divide pixels by width and height",
            )
        found.append(Shape(f"class {name}", rings=[[ring * size]]))
    return found
