"""Updates a drawn shape when its group is moved, scaled, mirrored or turned.

The contract still says what is drawn if it can: in another box, or through points of its own.
Mirrored letters stay readable; turned letters and grids become free positions. Frame: image pixels,
y down; maps take row vectors.
"""

from typing import NamedTuple

import numpy as np

from ...geometry.figures.shapes import Sketch
from ...geometry.outline import FloatArray
from ..contract import Group, ShapeSpec

DECIMALS = 6
"""Decimals that coordinates and lengths of an edited contract are rounded to, px."""
WRITTEN = frozenset({"letters", "outlined_letters"})


class Affine(NamedTuple):
    """An affine map of the plane that takes the row vector p to (p - origin) linear + to."""

    linear: FloatArray
    origin: FloatArray
    to: FloatArray

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the images of points (k, 2)."""
        return (points - self.origin) @ self.linear + self.to

    @property
    def upright(self) -> bool:
        """Whether it only translates and scales."""
        return bool((self.linear == np.eye(2) * self.linear[0, 0]).all()) and self.linear[0, 0] > 0

    @property
    def mirrors(self) -> bool:
        """Whether it reverses orientation."""
        return float(np.linalg.det(self.linear)) < 0


def form_after(group: Group, figure: Sketch, there: Affine) -> tuple[Group, bool]:
    """Return the group after a map has moved its shape, and whether its robots need new places.

    They do if the images of their places are not places of the new shape.
    """
    shape = group.shape
    assert shape is not None
    targets = () if group.enters else group.targets
    kept = group.model_copy(update={"targets": targets, "clearance": None})
    boxable = shape.points is None and shape.mouth is None
    if boxable and (there.upright or shape.kind == "circle"):
        return _with_shape(kept, _boxed(shape, figure, there)), False
    if len(figure.lines) == 1 and figure.places is None and shape.kind not in WRITTEN:
        points = tuple((float(x), float(y)) for x, y in there(figure.lines[0]).round(DECIMALS))
        return _with_shape(kept, ShapeSpec(kind="polyline", points=points)), False
    if there.mirrors:
        return _with_shape(kept, _boxed(shape, figure, there)), True
    return _with_shape(kept, None), False


def _with_shape(group: Group, shape: ShapeSpec | None) -> Group:
    return group.model_copy(update={"shape": shape})


def _boxed(shape: ShapeSpec, figure: Sketch, there: Affine) -> ShapeSpec:
    """Return the same shape in the box that the map takes its frame to."""
    middle = there(np.reshape(figure.frame, (2, 2)).mean(axis=0))
    half = np.asarray(figure.size) * np.sqrt(abs(np.linalg.det(there.linear))) / 2
    low, high = (middle - half).round(DECIMALS), (middle + half).round(DECIMALS)
    box = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    return shape.model_copy(update={"box": box, "where": None})
