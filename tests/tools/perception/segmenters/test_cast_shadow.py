"""A shadow beside a thing is left out; dark parts of the thing itself are not."""

import numpy as np
import pytest
from formup.tools.perception.segmenters.segment import segment_box

GROUND, THING, SHADOW = (120, 118, 112), (215, 208, 200), (28, 28, 30)


def picture(dark: tuple[slice, slice]) -> np.ndarray:
    """A bright roof of 100 x 60 px on grey ground, with something dark."""
    random = np.random.default_rng(3)
    pixels = np.full((240, 320, 3), GROUND, np.float64)
    pixels[90:150, 100:200] = THING
    pixels[dark] = SHADOW
    return (pixels + random.normal(0, 4, pixels.shape)).clip(0, 255).astype(np.uint8)


def test_a_shadow_along_one_side_is_left_out() -> None:
    found = segment_box(picture((slice(150, 172), slice(100, 200))), (97.0, 86.0, 204.0, 155.0))
    assert found.mask[95:145, 105:195].mean() > 0.98
    assert found.mask[155:172, 105:195].mean() < 0.05


@pytest.mark.parametrize(
    "dark",
    [(slice(110, 130), slice(120, 150)), (slice(90, 150), slice(140, 160))],
    ids=["window", "band across"],
)
def test_a_dark_part_of_the_thing_stays(dark: tuple[slice, slice]) -> None:
    found = segment_box(picture(dark), (96.0, 86.0, 204.0, 154.0))
    assert found.mask[92:148, 102:198].mean() > 0.95


def test_a_dark_thing_beside_something_bright_is_not_its_shadow() -> None:
    """The box says which of the two is meant."""
    pixels = picture((slice(150, 210), slice(100, 200)))
    found = segment_box(pixels, (97.0, 147.0, 204.0, 213.0))
    assert found.mask[155:205, 105:195].mean() > 0.9
