"""Masks and the outlines of them agree to the pixel."""

import cv2
import numpy as np
import pytest
from formup.tools.errors import InputError
from formup.tools.perception.contours import mask_of_outline, outline_of_mask
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def empty() -> Mask:
    return np.zeros((60, 80), dtype=bool)


def blob(seed: int) -> Mask:
    """One connected smooth blob with whatever holes it has."""
    rng = np.random.default_rng(seed)
    field = cv2.GaussianBlur(rng.normal(0, 1, (60, 80)).astype(np.float32), (0, 0), 4)
    _, labels = cv2.connectedComponents((field > 0).astype(np.uint8), connectivity=4)
    sizes = np.bincount(labels.ravel())
    return np.asarray(labels == 1 + int(np.argmax(sizes[1:])), dtype=np.bool_)


@pytest.mark.parametrize("seed", range(40))
def test_a_blobs_outline_covers_its_pixels_and_no_more(seed: int) -> None:
    mask = blob(seed)
    outline = outline_of_mask(mask)
    again = mask_of_outline(outline, 80, 60)
    assert (again & mask).sum() == mask.sum(), "every pixel of the mask is in its outline"
    assert outline.area == pytest.approx(mask.sum(), rel=0.06)
    assert (again ^ mask).sum() <= 0.06 * mask.sum()


@pytest.mark.parametrize("box", [(5, 15, 5, 15), (0, 60, 0, 80), (10, 12, 3, 70), (0, 2, 0, 2)])
def test_a_box_of_pixels_has_exactly_their_area(box: tuple[int, int, int, int]) -> None:
    top, bottom, left, right = box
    mask = empty()
    mask[top:bottom, left:right] = True
    outline = outline_of_mask(mask)
    assert outline.area == pytest.approx(mask.sum())
    assert outline.bounds == (left - 0.5, top - 0.5, right - 0.5, bottom - 0.5)
    assert np.array_equal(mask_of_outline(outline, 80, 60), mask)


def test_a_hole_stays_a_hole() -> None:
    mask = empty()
    mask[5:50, 5:60] = True
    mask[20:30, 20:40] = False
    outline = outline_of_mask(mask)
    assert outline.area == pytest.approx(mask.sum(), abs=1.5)
    assert len(outline.polygon.interiors) == 1
    assert not mask_of_outline(outline, 80, 60)[25, 30]


def test_of_two_parts_the_larger_is_kept() -> None:
    mask = empty()
    mask[2:8, 2:8] = True
    mask[20:50, 20:60] = True
    assert outline_of_mask(mask).area == pytest.approx(30 * 40)


@pytest.mark.parametrize("pixels", [0, 1, 2, 3])
def test_too_few_pixels_are_refused(pixels: int) -> None:
    mask = empty()
    mask[5, 5 : 5 + pixels] = True
    with pytest.raises(InputError):
        outline_of_mask(mask)


def test_three_pixels_round_a_corner_are_refused() -> None:
    mask = empty()
    mask[5, 5] = mask[5, 6] = mask[6, 5] = True
    with pytest.raises(InputError):
        outline_of_mask(mask)


def test_lines_of_single_pixels_are_refused() -> None:
    row, diagonal = empty(), empty()
    row[5, 5:50] = True
    np.fill_diagonal(diagonal, True)
    for mask in (row, row[:, ::-1], diagonal):
        with pytest.raises(InputError):
            outline_of_mask(mask)
