"""Reads from a GeoTIFF's tags where on the Earth its pixels lie, and how large they are.

Tags that leave doubt give no scale, and a reason: a wrong scale would send robots wrong distances.
"""

import math
from dataclasses import dataclass

import numpy as np
from PIL import Image, TiffImagePlugin

from ..geometry.outline import FloatArray

PIXEL_SCALE, TIE_POINT, TRANSFORM, KEYS = 33550, 33922, 34264, 34735
MODEL, GEOGRAPHIC_CRS, PROJECTED_CRS, LINEAR_UNIT = 1024, 2048, 3072, 3076
"""Keys of the GeoKey directory, as numbered by the standard (OGC 19-008r4)."""
UNITS = {9001: 1.0, 9002: 0.3048, 9003: 1200 / 3937}
"""Metres per unit of a map, by the unit's EPSG code: metre, foot, US survey foot."""
UTM = (range(32601, 32661), range(32701, 32761), range(25828, 25839), range(26901, 26924))
"""EPSG codes of maps that are in metres if the file does not state a unit."""
WEB_MERCATOR, RADIUS = frozenset({3857, 3785, 900913}), 6378137.0
"""EPSG codes and radius, m, of a map whose metres exceed the ground's, depending on latitude."""
UNEVEN, TURNED = 1.01, 0.02
"""Greatest ratio of a pixel's sides for there to be one scale, and greatest turn on the map."""
POSSIBLE = (1e-6, 1e3)
"""Least and greatest metres per pixel that are plausible."""


@dataclass(frozen=True, eq=False)
class Georeference:
    """How a picture lies on its map.

    Attributes:
        matrix: (3, 3), maps (column, row, 1) of a pixel centre to (x, y, 1) on the map.
        geographic: whether x and y are longitude and latitude.
        crs: EPSG code of the map; 0 if not stated.
        metres_per_pixel: the scale; None if there is no single scale, or none that is certain.
        note: the scale in words, or why there is none.
    """

    matrix: FloatArray
    geographic: bool
    crs: int
    metres_per_pixel: float | None
    note: str

    def to_pixels(self, points: FloatArray) -> FloatArray:
        """Return the pixels (n, 2) of places (n, 2) on the map."""
        there = np.column_stack([points, np.ones(len(points))])
        return (there @ np.linalg.inv(self.matrix).T)[:, :2]


def georeference_of(opened: Image.Image) -> Georeference | None:
    """Read the georeference from a TIFF's tags; None if there is none, or none that is valid."""
    if not isinstance(opened, TiffImagePlugin.TiffImageFile):
        return None
    tags, size = opened.tag_v2, opened.size
    try:
        keys = _keys([int(v) for v in tags.get(KEYS, ())])
        numbers = ([float(v) for v in tags.get(t, ())] for t in (PIXEL_SCALE, TIE_POINT, TRANSFORM))
        matrix = _matrix(*numbers)
    except (TypeError, ValueError, OverflowError):
        return None
    model = keys.get(MODEL)
    if matrix is None or model not in (1, 2):
        return None
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix)) < 1e-18:
        return None
    crs = keys.get(GEOGRAPHIC_CRS if model == 2 else PROJECTED_CRS, 0)
    centre = matrix @ [(size[0] - 1) / 2, (size[1] - 1) / 2, 1.0]
    metres = _metres(keys, crs, float(centre[1]), geographic=model == 2)
    scale, note = _scale(matrix[:2, :2], metres)
    name = f"EPSG:{crs}" if crs not in (0, 32767) else "a map without a number"
    return Georeference(matrix, model == 2, crs, scale, f"{note} ({name})")


def _keys(values: list[int]) -> dict[int, int]:
    """Return the keys whose values are stored in the directory itself."""
    entries = (values[i : i + 4] for i in range(4, len(values) - 3, 4))
    return {key: value for key, place, _, value in entries if place == 0}


def _matrix(scale: list[float], tie: list[float], transform: list[float]) -> FloatArray | None:
    """Return the matrix (3, 3) from pixel centres to the map; None if the tags give none.

    The tags count pixels from the outer corner of the first one.
    """
    if len(transform) == 16:
        whole = np.array(transform).reshape(4, 4)[np.ix_((0, 1, 3), (0, 1, 3))]
    elif len(scale) >= 2 and len(tie) >= 6:
        column, row, _, x, y = tie[:5]
        sx, sy = scale[:2]
        whole = np.array([[sx, 0, x - column * sx], [0, -sy, y + row * sy], [0, 0, 1]])
    else:
        return None
    return whole @ np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])


def _metres(
    keys: dict[int, int], crs: int, y: float, *, geographic: bool
) -> tuple[float, float] | None:
    """Return the metres on the ground of one unit of the map in x and in y, at a map's y.

    None if the map's unit is unknown.
    """
    if geographic:  # length of a degree on the WGS 84 ellipsoid
        lat = math.radians(y)
        along = 111412.84 * math.cos(lat) - 93.5 * math.cos(3 * lat)
        return along, 111132.92 - 559.82 * math.cos(2 * lat) + 1.175 * math.cos(4 * lat)
    unit = UNITS.get(keys.get(LINEAR_UNIT, 9001 if any(crs in zone for zone in UTM) else 0))
    if crs in WEB_MERCATOR:
        unit = 1 / math.cosh(min(abs(y) / RADIUS, 9.0))
    return None if unit is None else (unit, unit)


def _scale(matrix: FloatArray, metres: tuple[float, float] | None) -> tuple[float | None, str]:
    """Return the metres per pixel, None if there is no single such number, and a note on it."""
    none = "the file's georeference gives no scale"
    if metres is None:
        return None, f"{none}: the unit of its map is not known"
    ground = np.diag(metres) @ matrix
    across, down = (float(v) for v in np.linalg.norm(ground, axis=0))
    if max(across, down) > UNEVEN * min(across, down):
        return None, f"{none}: its pixels are {across:.4g} m wide and {down:.4g} m high"
    scale = math.sqrt(across * down)
    if np.abs(ground / scale - ((1, 0), (0, -1))).max() > TURNED:
        return None, f"{none}: the picture is turned or mirrored on its map"
    if not POSSIBLE[0] <= scale <= POSSIBLE[1]:
        return None, f"{none}: {scale:.4g} m per pixel is none that a picture has"
    return scale, f"scale {scale:.4g} m per pixel, from the file's georeference"
