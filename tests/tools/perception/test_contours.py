"""Outlines of masks: exact whatever the size of the picture, and no finer than the thing is."""

import cv2
import numpy as np
import shapely
from formup.tools.perception.contours import outline_of_mask
from numpy.typing import NDArray


def disc(size: int, radius: int) -> NDArray[np.bool_]:
    canvas = np.zeros((size, size), np.uint8)
    cv2.circle(canvas, (size // 2, size // 2), radius, (1,), -1)
    return canvas.astype(bool)


def test_a_thing_has_the_same_outline_wherever_it_lies_in_a_picture() -> None:
    small = disc(100, 30)
    small[45:55, 45:55] = False
    large = np.zeros((900, 1200), bool)
    large[700:800, 40:140] = small
    moved = shapely.transform(outline_of_mask(small).polygon, lambda at: at + np.array((40, 700)))
    assert outline_of_mask(large).polygon.equals_exact(moved, 1e-9)


def test_the_outline_of_a_large_thing_has_no_more_detail_than_that_of_a_small_one() -> None:
    small, large = outline_of_mask(disc(300, 100)), outline_of_mask(disc(6000, 2000))
    few, many = (shapely.get_num_coordinates(o.polygon) for o in (small, large))
    assert many < 3 * few
    assert abs(large.area / (np.pi * 2000.5**2) - 1) < 1e-3
