"""Pictures of more than 8 bits: what is dead or empty takes no contrast from the rest."""

from io import BytesIO
from typing import Any

import cv2
import numpy as np
import pytest
from formup.tools.perception.image import Picture, picture_from_bytes
from numpy.typing import NDArray
from PIL import Image

GROUND, PLATE = (10, 10), (130, 170)


def field(low: float, high: float, kind: Any) -> NDArray[Any]:
    """A brighter plate on a flat ground, both with soft noise."""
    noise = np.random.default_rng(5).normal(0, (high - low) * 0.01, (260, 360))
    values = np.full((260, 360), low, float)
    values[90:170, 120:220] = high
    return (values + noise).astype(kind)


def loaded(values: NDArray[Any]) -> Picture:
    done, data = cv2.imencode(".tif" if values.dtype == np.float32 else ".png", values)
    assert done
    return picture_from_bytes(data.tobytes(), "deep")


def spoilt(kind: Any, where: str, value: float) -> NDArray[Any]:
    values = field(900, 1500, kind)
    places = {"dead pixels": (slice(5, None, 50), slice(7, None, 60)), "a row": (30,)}
    values[places.get(where, (slice(180, None), slice(200, None)))] = value
    return values


@pytest.mark.parametrize("where", ["dead pixels", "a row", "a corner"])
@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (np.uint16, 65535),
        (np.uint16, 0),
        (np.float32, 3.4e38),
        (np.float32, -3.4e38),
        (np.float32, -9999),
    ],
)
def test_what_is_dead_or_empty_is_left_out_and_said(kind: Any, where: str, value: float) -> None:
    values = spoilt(kind, where, value)
    picture = loaded(values)
    (note,) = picture.notes
    assert f"{np.count_nonzero(values == kind(value)):,} dead or empty ones left out" in note
    shown = picture.pixels[:, :, 0].astype(int)
    assert shown[PLATE] - shown[GROUND] > 180
    assert set(np.unique(shown[values == kind(value)])) == {255 if value > 1500 else 0}
    rest = shown[values != kind(value)]
    assert (rest.min() >= 32) if value < 900 else (rest.max() <= 223)


def test_dead_pixels_of_many_values_at_both_ends() -> None:
    values = field(900, 1500, np.uint16)
    values[5::50, 7::60] = np.random.default_rng(1).integers(3000, 65535, (6, 6))
    values[6::50, 7::60] = 0
    shown = loaded(values).pixels[:, :, 0].astype(int)
    assert shown[PLATE] - shown[GROUND] > 150


@pytest.mark.parametrize("noise", [0, 1, 100, 1000])
def test_a_bright_thing_on_a_ground_of_noise_alone_is_no_empty_value(noise: int) -> None:
    random = np.random.default_rng(5)
    values = random.normal(3000, noise / 3, (260, 360)).astype(np.uint16)
    values[90:170, 120:220] = 65535
    picture = loaded(values)
    assert "left out" not in picture.notes[0]
    assert int(picture.pixels[PLATE][0]) - int(picture.pixels[GROUND][0]) > 240


def test_a_textured_bright_half_keeps_its_texture() -> None:
    values = np.tile(np.linspace(900, 1000, 360), (260, 1)).astype(np.uint16)
    values[:, 200:] += 30_000
    assert loaded(values).notes == ("grey values 900 to 31000 stretched from black to white",)


def test_8_bits_in_16_stay_whatever_is_dead() -> None:
    values = field(30, 200, np.uint16)
    values[5::50, 7::60] = 65535
    picture = loaded(values)
    assert np.array_equal(picture.pixels[:, :, 0], np.minimum(values, 255))
    assert picture.notes == ("36 dead or empty ones left out of account",)


def test_10_bits_of_each_colour_are_stretched_together() -> None:
    values = field(120, 700, np.uint16)
    picture = loaded(np.dstack([values // 2, values, values]))  # blue, green, red
    red, green, blue = picture.pixels[PLATE].astype(int)
    assert red == green > 220
    assert 90 < blue < 130
    assert picture.notes[0].startswith("colour values")


def test_colour_that_uses_its_16_bits_stays() -> None:
    values = field(9000, 52000, np.uint16)
    picture = loaded(np.dstack([values, values, values]))
    assert np.abs(picture.pixels[:, :, 0] - values / 257).max() <= 1
    assert picture.notes == ()


def test_deep_pictures_are_turned_upright_too() -> None:
    file, exif = BytesIO(), Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(field(900, 1500, np.uint16)).save(file, "PNG", exif=exif)
    assert picture_from_bytes(file.getvalue(), "turned").size == (260, 360)
