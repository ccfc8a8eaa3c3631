"""Fits the homography of a floor to known points on it, and refuses points that do not fit."""

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...geometry.outline import FloatArray
from ...yaml_files import validated
from .calibration import Calibration, Lens, Residuals, through
from .known import Known, read_lens

LARGE = 0.005
"""Greatest error of a known point, as a share of the picture's diagonal."""
UNSURE = 0.01
"""Greatest expected error of the floor's corners, as a share of its diagonal."""
CLICK = 0.1
"""Least error of pixels assumed in estimating that of the corners, px."""
FLAT = 0.02
"""Points lie on a line if their spread across it is at most this share of that along it."""


def calibrated(known: Known, pixels: NDArray[np.uint8], path: Path) -> Calibration:
    """Calibrate the camera that took a picture.

    Args:
        known: what is known of the floor and the camera.
        pixels: the picture, (H, W, 3) RGB.
        path: the file that states what is known, for messages.

    Raises:
        InputError: too few points, points on a line or inconsistent with the others, or a floor
            that is not entirely in the picture; names the points.
    """
    size = pixels.shape[1], pixels.shape[0]
    names, at, floor = known.found(pixels)
    lens = None if known.lens is None else read_lens(known.lens, size)
    _check_points(names, at, floor, size)
    straight = at if lens is None else lens.undistorted(at)
    matrix = _fit_homography(straight, floor)
    off = _residuals(matrix, straight, floor)
    _check_fit(names, straight, floor, off, LARGE * math.hypot(*size))
    if not (_depths(matrix, straight) > 0).all():
        raise InputError(
            "These points would have the floor beyond the horizon: two of them are given each "
            "other's place; see which pixel goes with which place."
        )
    x0, y0, x1, y1 = rectangle = known.floor or (*floor.min(axis=0), *floor.max(axis=0))
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    mm = 1000 * np.linalg.norm(through(matrix, straight) - floor, axis=1)
    values = {
        "picture": size,
        "homography": matrix.tolist(),
        "lens": lens,
        "camera": known.camera or (None if lens is None else _camera(matrix, lens)),
        "floor": rectangle,
        "metres_per_pixel": _metres_per_pixel(matrix, corners.mean(axis=0)),
        "residuals": Residuals(
            mean_px=off.mean(),
            worst_px=off.max(),
            mean_mm=mm.mean(),
            worst_mm=mm.max(),
            corners_mm=_corner_error_mm(straight, floor, corners, max(float(off.mean()), CLICK)),
        ),
    }
    return validated(path, "a floor that can be used", Calibration, values)


def _corner_error_mm(
    pixels: FloatArray, floor: FloatArray, corners: FloatArray, noise: float
) -> float:
    """Estimate the error of the floor's worst corner, mm, from pixel noise, by simulation.

    Args:
        pixels, floor: the known points, (n, 2) px and (n, 2) m.
        corners: (4, 2), m.
        noise: standard deviation of the pixel noise, px.

    Raises:
        InputError: the error is too large.
    """
    rng, size = np.random.default_rng(0), float(np.linalg.norm(corners[2] - corners[0]))
    at = through(np.linalg.inv(_fit_homography(pixels, floor)), corners)
    tries = [_fit_homography(pixels + rng.normal(0, noise, pixels.shape), floor) for _ in range(30)]
    off = np.linalg.norm([through(matrix, at) - corners for matrix in tries], axis=2)
    worst = float(off.mean(axis=0).max())
    if worst > UNSURE * size:
        raise InputError(
            f"A corner of the floor may be off by {1000 * worst:.0f} mm, as what is known covers "
            "too little of it; lay out more points, or a larger board, further apart."
        )
    return 1000 * worst


def _fit_homography(pixels: FloatArray, floor: FloatArray) -> FloatArray:
    """Fit a homography (3, 3) from px to m, with the known points in front of the camera.

    Raises:
        InputError: no homography maps these points to these places.
    """
    found, _ = cv2.findHomography(pixels, floor, 0)
    if np.shape(found) != (3, 3):
        raise InputError("No view of a floor takes these points to these places; check them.")
    matrix = np.asarray(found, dtype=float)
    return matrix * np.sign(np.median(_depths(matrix, pixels)))


def _depths(matrix: FloatArray, pixels: FloatArray) -> FloatArray:
    return np.column_stack([pixels, np.ones(len(pixels))]) @ matrix[2]


def _residuals(matrix: FloatArray, pixels: FloatArray, floor: FloatArray) -> FloatArray:
    """Return the errors of points in the picture, (n,), px."""
    return np.linalg.norm(through(np.linalg.inv(matrix), floor) - pixels, axis=1)


def _check_points(
    names: Sequence[str], pixels: FloatArray, floor: FloatArray, size: tuple[int, int]
) -> None:
    if len(names) < 4:
        raise InputError(
            f"{len(names)} points are known, and a floor takes four or more, far apart; five or "
            "more show whether they are right."
        )
    inside = (pixels > -0.5) & (pixels < np.array(size) - 0.5)
    if not inside.all():
        named = ", ".join(name for name, both in zip(names, inside, strict=True) if not both.all())
        raise InputError(
            f"Point {named} is outside the picture of {size[0]} x {size[1]} pixels; give pixels of "
            "this picture."
        )
    for points, where in ((pixels, "in the picture"), (floor, "on the floor")):
        rest = (np.delete(points, i, axis=0) for i in range(len(points)))
        spreads = [np.linalg.svd(p - p.mean(axis=0), compute_uv=False) for p in (points, *rest)]
        if any(across <= FLAT * along for along, across in spreads):
            raise InputError(
                f"All points, or all but one, are on one line {where}; give four of which no three "
                "are, such as the corners of the floor."
            )


def _check_fit(
    names: Sequence[str], pixels: FloatArray, floor: FloatArray, off: FloatArray, limit: float
) -> None:
    """Refuse points that do not fit; if leaving out one of six or more mends it, name that one."""
    if off.max() <= limit:
        return
    worst = [i for i in np.argsort(-off) if off[i] > limit]
    if len(names) >= 6:
        for i in range(len(names)):
            rest = np.delete(pixels, i, axis=0), np.delete(floor, i, axis=0)
            matrix = _fit_homography(*rest)
            if _residuals(matrix, *rest).max() <= limit:
                worst, off = [i], _residuals(matrix, pixels, floor)
                break
    shown = ", ".join(f"{names[i]} by {off[i]:.1f} px" for i in worst[:10])
    raise InputError(
        f"Points do not fit one flat floor: {shown}, and {limit:.1f} px are allowed; measure these "
        "anew, or give a lens file if straight lines are bent in the picture."
    )


def _camera(matrix: FloatArray, lens: Lens) -> tuple[float, float, float]:
    """Return the camera's x and y on the floor and its height above it, m."""
    axes = np.linalg.inv(matrix @ np.array(lens.camera_matrix))
    axes *= np.sign(axes[2, 2]) * 2 / (np.linalg.norm(axes[:, 0]) + np.linalg.norm(axes[:, 1]))
    turn = np.column_stack([axes[:, :2], np.cross(axes[:, 0], axes[:, 1])])
    left, _, right = np.linalg.svd(turn)
    x, y, z = (-(left @ right).T @ axes[:, 2]).tolist()
    return x, y, abs(z)


def _metres_per_pixel(matrix: FloatArray, middle: FloatArray) -> float:
    """Return the metres per pixel at a place (2,) on the floor, m, to two digits."""
    at = through(np.linalg.inv(matrix), middle[None])
    area = abs(np.linalg.det(matrix)) / abs(_depths(matrix, at)[0]) ** 3
    return float(f"{math.sqrt(area):.2g}")
