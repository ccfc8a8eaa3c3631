"""Segmentation by pointing, on drawn scenes whose truth is known to the pixel."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from formup.tools.perception.segmenters.confidence import fitted_confidence
from formup.tools.perception.segmenters.segment import (
    Segmentation,
    segment_box,
    segment_outline,
    segment_points,
)

Mask = npt.NDArray[np.bool_]
Pixels = npt.NDArray[np.uint8]
Shape = tuple[int, int]
Colour = tuple[int, int, int]
Box = tuple[float, float, float, float]

ORANGE, GREEN, GREY = (200, 110, 40), (60, 130, 70), (120, 120, 118)


def textured(shape: Shape, colour: Colour, seed: int, noise: float = 6.0) -> Pixels:
    rng = np.random.default_rng(seed)
    blotches = cv2.GaussianBlur(rng.normal(0, 40, shape).astype(np.float32), (0, 0), 4)
    grain = rng.normal(0, noise, (*shape, 3))
    return np.clip(np.array(colour) + blotches[..., None] + grain, 0, 255).astype(np.uint8)


def scene(
    mask: Mask, colour: Colour = ORANGE, ground: Colour = GREEN, noise: float = 6.0
) -> Pixels:
    shape = mask.shape[0], mask.shape[1]
    picture = textured(shape, ground, 1, noise)
    picture[mask] = textured(shape, colour, 2, noise)[mask]
    return picture


def disc(shape: Shape, centre: tuple[int, int], radius: int) -> Mask:
    y, x = np.ogrid[: shape[0], : shape[1]]
    return (x - centre[0]) ** 2 + (y - centre[1]) ** 2 <= radius**2


def ell() -> Mask:
    mask = np.zeros((240, 320), dtype=np.bool_)
    mask[50:190, 90:140] = True
    mask[140:190, 90:230] = True
    return mask


def box_around(mask: Mask, by: float = 0.0) -> Box:
    y, x = np.nonzero(mask)
    return (float(x.min() - by), float(y.min() - by), float(x.max() + by), float(y.max() + by))


def iou(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / (one | other).sum())


def is_nothing(result: Segmentation, shape: Shape) -> bool:
    return result.mask.shape == shape and not result.mask.any() and result.confidence == 0.0


DISC = disc((240, 320), (150, 120), 60)


@pytest.mark.parametrize("by", [-6, 0, 6])
def test_a_box_finds_the_disc_and_the_l_shape(by: float):
    for mask in (DISC, ell()):
        found = segment_box(scene(mask), box_around(mask, by))
        assert iou(found.mask, mask) > 0.93
        assert found.confidence > 0.7


def test_an_outline_finds_the_l_shape():
    rough = [(95, 43), (146, 54), (135, 146), (236, 136), (226, 197), (84, 184)]
    assert iou(segment_outline(scene(ell()), rough).mask, ell()) > 0.95


def test_four_vertices_are_a_rotated_box():
    mask = np.zeros((240, 320), dtype=np.uint8)
    cv2.fillPoly(mask, [np.array([(60, 120), (200, 40), (230, 95), (90, 175)])], (1,))
    rough = [(56, 123), (205, 37), (233, 99), (86, 179)]
    assert iou(segment_outline(scene(mask > 0), rough).mask, mask > 0) > 0.94


@pytest.mark.parametrize("where", [(150, 120), (120, 105), (170, 150)])
def test_a_point_finds_the_disc(where: tuple[int, int]):
    found = segment_points(scene(DISC), [where])
    assert iou(found.mask, DISC) > 0.93


def test_points_on_two_colours_find_the_whole():
    mask = np.zeros((240, 320), dtype=np.bool_)
    mask[80:160, 90:230] = True
    picture = scene(mask)
    picture[80:160, 160:230] = textured((80, 70), (150, 40, 160), 3)
    assert iou(segment_points(picture, [(120, 120), (195, 120)]).mask, mask) > 0.9


def test_a_ring_keeps_its_hole():
    ring = DISC & ~disc((240, 320), (150, 120), 32)
    found = segment_box(scene(ring), box_around(ring, 3))
    assert iou(found.mask, ring) > 0.9
    assert not found.mask[120, 150]


def test_a_shaded_loop_on_plain_ground_is_open_unless_pointed_at():
    shape = (240, 320)
    inside = disc(shape, (110, 120), 26)
    handle = disc(shape, (110, 120), 40) & ~inside
    handle[112:128, 148:260] = True
    picture = np.full((*shape, 3), (205, 195, 180), dtype=np.uint8)
    picture[inside] = (190, 180, 166)
    picture[handle] = (30, 32, 38)
    picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), 1.0), dtype=np.uint8)
    found = segment_box(picture, box_around(handle, 4))
    assert iou(found.mask, handle) > 0.85
    assert not found.mask[120, 110]
    assert segment_box(picture, box_around(handle, 4), positive=[(110.0, 120.0)]).mask[120, 110]


def test_low_contrast_is_enough():
    picture = scene(DISC, colour=(138, 126, 112), ground=GREY, noise=3.0)
    assert iou(segment_box(picture, box_around(DISC, 4)).mask, DISC) > 0.85


def test_a_thin_thing_survives_the_erosion_of_its_outline():
    bar = np.zeros((240, 320), dtype=np.uint8)
    cv2.line(bar, (40, 200), (280, 40), 1, 7)
    rough = [(36, 196), (278, 32), (286, 45), (43, 207)]
    found = segment_outline(scene(bar > 0, colour=(30, 30, 35)), rough)
    assert iou(found.mask, bar > 0) > 0.75


def test_a_thing_at_the_border():
    mask = disc((240, 320), (0, 120), 70)
    assert iou(segment_box(scene(mask), box_around(mask)).mask, mask) > 0.93


def test_a_box_of_the_whole_picture():
    found = segment_box(scene(DISC), (0.0, 0.0, 319.0, 239.0))
    assert iou(found.mask, DISC) > 0.9


def test_a_negative_point_removes_a_part():
    left, right = disc((240, 320), (110, 120), 40), disc((240, 320), (200, 120), 40)
    picture = scene(left | right)
    picture[right] = textured((240, 320), (150, 40, 160), 3)[right]
    whole = segment_box(picture, box_around(left | right, 3))
    part = segment_box(picture, box_around(left | right, 3), negative=[(200.0, 120.0)])
    assert iou(whole.mask, left | right) > 0.9
    assert iou(part.mask, left) > 0.85


def test_a_positive_point_adds_a_part():
    spot = disc((240, 320), (225, 180), 6)
    picture = scene(DISC | spot)
    box = box_around(DISC | spot)
    assert not segment_box(picture, box).mask[180, 225]
    assert segment_box(picture, box, positive=[(225.0, 180.0)]).mask[180, 225]


@pytest.mark.parametrize("shape", [(60, 80), (3, 3), (1, 1)])
def test_one_colour_holds_nothing(shape: Shape):
    picture = np.full((*shape, 3), 130, dtype=np.uint8)
    height, width = shape
    right, low = float(width - 1), float(height - 1)
    middle = (right / 2, low / 2)
    assert is_nothing(segment_box(picture, (0.0, 0.0, right, low)), shape)
    assert is_nothing(segment_points(picture, [middle]), shape)
    assert is_nothing(segment_outline(picture, [(0, 0), (right, 0), (0, low)]), shape)


def test_tiny_prompts_and_pictures_are_survived():
    tiny = np.random.default_rng(0).integers(0, 256, (3, 3, 3), dtype=np.uint8)
    picture = scene(DISC)
    results = [
        (segment_box(tiny, (0.0, 0.0, 2.0, 2.0)), tiny),
        (segment_points(tiny, [(1.0, 1.0)]), tiny),
        (segment_outline(tiny, [(0, 0), (2, 0), (1, 2)]), tiny),
        (segment_box(picture, (150.0, 120.0, 151.0, 122.0)), picture),
        (segment_box(picture, (318.0, 238.0, 319.0, 239.0)), picture),
        (segment_outline(picture, [(0, 0), (2, 0), (1, 1)]), picture),
        (segment_points(picture, [(0.0, 239.0)], negative=[(319.0, 0.0)]), picture),
    ]
    for found, pixels in results:
        assert found.mask.shape == pixels.shape[:2]
        assert 0.0 <= found.confidence <= 1.0


def test_the_same_input_gives_the_same_mask():
    picture = scene(ell())
    cv2.setRNGSeed(1)
    first = segment_box(picture, box_around(ell(), 5))
    cv2.setRNGSeed(2)
    second = segment_box(picture, box_around(ell(), 5))
    assert np.array_equal(first.mask, second.mask)
    assert first.confidence == second.confidence


def test_the_mask_moves_with_the_picture():
    picture = scene(DISC)
    found = segment_box(picture, box_around(DISC, 4))
    moved = np.roll(picture, (10, 20), axis=(0, 1))
    shifted = segment_box(moved, box_around(np.roll(DISC, (10, 20), axis=(0, 1)), 4))
    assert np.array_equal(np.roll(found.mask, (10, 20), axis=(0, 1)), shifted.mask)


def test_a_large_picture_has_smooth_outlines():
    mask = disc((1800, 2400), (1200, 900), 600)
    found = segment_box(scene(mask, noise=0.0), box_around(mask, 20))
    assert iou(found.mask, mask) > 0.97
    contours, _ = cv2.findContours(
        found.mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    # A blocky disc is as long around as its bounding square.
    assert cv2.arcLength(contours[0], True) < 1.15 * 2 * np.pi * 600


def test_a_wrong_box_is_trusted_less():
    picture = scene(DISC)
    good = segment_box(picture, box_around(DISC, 4))
    half_off = segment_box(picture, (150.0, 120.0, 270.0, 230.0))
    ground = segment_box(picture, (230.0, 20.0, 300.0, 90.0))
    assert half_off.confidence < good.confidence - 0.1
    assert ground.confidence < good.confidence - 0.3


def test_the_confidence_is_what_the_cues_come_to() -> None:
    found = segment_box(scene(DISC), box_around(DISC, 4))
    assert all(0 <= value <= 1 for value in found.parts.values())
    assert found.confidence == pytest.approx(fitted_confidence("box", found.parts))
    assert found.confidence > 0.8


def test_a_mask_that_ends_where_there_is_no_edge_is_not_believed() -> None:
    """A soft spot that fades into the ground has no outline anybody could find."""
    y, x = np.mgrid[:240, :320].astype(np.float32)
    spot = 30 * np.exp(-((x - 160) ** 2 + (y - 120) ** 2) / (2 * 45**2))
    picture = np.clip(np.array(GREY) + spot[..., None], 0, 255).astype(np.uint8)
    found = segment_box(picture, (100.0, 60.0, 220.0, 180.0))
    assert found.parts.get("edge_support", 0.0) < 0.9
    assert found.confidence < 0.6
