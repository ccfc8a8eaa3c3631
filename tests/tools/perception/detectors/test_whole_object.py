"""From a point on a part to the whole thing, and when to doubt it."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from formup.evals.tasks.suites import load_suite
from formup.tools.perception.contours import mask_of_outline
from formup.tools.perception.image import load_picture
from formup.tools.perception.segmenters.segment import segment_points

PHOTO = Path(__file__).parents[4] / "evals/photos/images/cars_two.jpg"


def two_coloured(ground: tuple[int, int, int]) -> npt.NDArray[np.uint8]:
    """A red 80 x 120 block with a grey window in it, on plain ground."""
    random = np.random.default_rng(0)
    picture = np.full((240, 320, 3), ground, float)
    picture[60:180, 120:200] = (190, 50, 60)
    picture[85:125, 130:190] = (110, 115, 120)
    return np.clip(picture + random.normal(0, 4, picture.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("point", [(160, 150), (126, 70), (190, 170)])
def test_a_point_on_a_part_finds_the_whole_thing(point: tuple[int, int]) -> None:
    truth = np.zeros((240, 320), dtype=bool)
    truth[60:180, 120:200] = True
    found = segment_points(two_coloured((60, 130, 70)), [point])
    overlap = (found.mask & truth).sum() / (found.mask | truth).sum()
    assert overlap > 0.9


def test_a_thing_on_plain_ground_is_not_taken_for_a_part() -> None:
    """A disc on a mat on a floor: the disc is meant."""
    picture = two_coloured((60, 130, 70))
    picture[60:180, 120:200] = (190, 50, 60)
    y, x = np.ogrid[:240, :320]
    disc = (x - 160) ** 2 + (y - 120) ** 2 <= 18**2
    picture[disc] = (240, 240, 235)
    found = segment_points(picture, [(160, 120)])
    assert (found.mask & disc).sum() / (found.mask | disc).sum() > 0.85


@pytest.mark.parametrize("point", [(390, 260), (400, 330), (380, 140), (345, 300)])
def test_any_point_on_the_car_finds_the_car(point: tuple[int, int]) -> None:
    car = next(t for t in load_suite("photos").tasks if t.id == "cars_two_t1").things[0]
    picture = load_picture(PHOTO)
    truth = mask_of_outline(car.outline, picture.width, picture.height)
    found = segment_points(picture.pixels, [point])
    assert (found.mask & truth).sum() / (found.mask | truth).sum() > 0.8
    assert found.confidence > 0.4


def test_what_may_be_a_part_is_doubted() -> None:
    """A cross of two colours is no compact whole, so the part is kept, at a lower confidence."""
    picture = np.full((240, 320, 3), (60, 130, 70), np.uint8)
    picture[30:210, 145:175] = (70, 70, 200)
    picture[105:135, 70:250] = (70, 70, 200)
    picture[90:150, 130:190] = (200, 60, 50)
    found = segment_points(picture, [(160, 120)])
    assert found.parts["unrivalled"] < 0.6
    plain = np.full((240, 320, 3), (60, 130, 70), np.uint8)
    plain[90:150, 130:190] = (200, 60, 50)
    assert found.confidence < segment_points(plain, [(160, 120)]).confidence
