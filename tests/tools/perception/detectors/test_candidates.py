"""Things found without weights: in real photographs, and in drawings whose truth is known."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
import shapely
from formup.tools.perception.detectors.candidates import find_candidates, salient_candidates
from formup.tools.perception.image import load_picture
from formup.tools.perception.referring.attributes import Candidate
from shapely import affinity
from shapely.geometry import Point, Polygon, box
from shapely.geometry.base import BaseGeometry

Pixels = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

PHOTOS = Path(__file__).parents[4] / "evals/photos"
SHAPE = (240, 320)
GREY, ORANGE, BLUE, RED, WHITE = (
    (150, 150, 146),
    (200, 110, 40),
    (40, 70, 190),
    (190, 40, 40),
    (235, 235, 235),
)
# Per photograph: the first so many candidates hold these objects with at least this overlap.
FOUND: list[tuple[str, int, dict[str, float]]] = [
    ("us_coins.jpg", 10, {"largest": 0.94, "lone_penny": 0.92, "dime": 0.91}),
    ("smarties.png", 10, {"orange_top": 0.93, "green_left": 0.92, "red_mid": 0.83}),
    ("table_stuff.jpg", 6, {"white_disc": 0.87, "dark_disc": 0.76, "coin": 0.93, "pencil": 0.83}),
    ("ucm_golfcourse15.jpg", 2, {"bunker": 0.94}),
    ("ucm_golfcourse24.jpg", 2, {"bunker": 0.91}),
    ("cars_two.jpg", 2, {"red_car": 0.86, "silver_car": 0.7}),
]


def ground(colour: Colour = GREY, noise: float = 3.0, seed: int = 1) -> Pixels:
    grain = np.random.default_rng(seed).normal(0, noise, (*SHAPE, 3))
    return np.clip(np.array(colour) + grain, 0, 255).astype(np.uint8)


def painted(*things: tuple[BaseGeometry, Colour], on: Pixels | None = None) -> Pixels:
    """The things painted on a picture, the last one on top."""
    picture = ground() if on is None else on.copy()
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]]
    for seed, (shape, colour) in enumerate(things, start=2):
        mask = np.asarray(shapely.contains_xy(shape, x, y), dtype=np.bool_)
        picture[mask] = ground(colour, seed=seed)[mask]
    return picture


def disc(x: float, y: float, radius: float) -> Polygon:
    return Point(x, y).buffer(radius, 32)


def iou(candidate: Candidate, truth: BaseGeometry) -> float:
    found = candidate.outline.polygon
    return float(found.intersection(truth).area / found.union(truth).area)


def best(candidates: Sequence[Candidate], truth: BaseGeometry) -> tuple[float, Candidate]:
    return max(((iou(c, truth), c) for c in candidates), key=lambda pair: pair[0])


def checked(cell: int, one: Colour, other: Colour) -> Pixels:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    squares = (y // cell + x // cell) % 2 == 0
    return np.where(squares[..., None], ground(one), ground(other, seed=2)).astype(np.uint8)


@pytest.mark.parametrize(("image", "first", "floors"), FOUND, ids=[f[0] for f in FOUND])
def test_things_of_photographs_are_among_the_first(
    image: str, first: int, floors: dict[str, float]
) -> None:
    entries: list[dict[str, Any]] = json.loads((PHOTOS / "annotations.json").read_text())
    entry = next(e for e in entries if e["image"] == f"images/{image}")
    truth = {o["id"]: Polygon(o["polygon"], o.get("holes", [])) for o in entry["objects"]}
    found = find_candidates(load_picture(PHOTOS / "images" / image).pixels)[:first]
    overlaps = {name: best(found, truth[name])[0] for name in floors}
    assert {name: v for name, v in overlaps.items() if v < floors[name]} == {}


def test_a_disc_is_one_thing_with_its_colour_and_shape() -> None:
    truth = disc(120, 110, 45)
    (only,) = find_candidates(painted((truth, ORANGE)))
    assert iou(only, truth) > 0.96
    assert only.label == "orange circle"
    assert only.attributes.centre == pytest.approx((120, 110), abs=1)
    assert only.attributes.hole == 0
    assert not only.attributes.touches_border


def test_a_ring_keeps_its_hole() -> None:
    truth = disc(120, 110, 45).difference(disc(120, 110, 25))
    (only,) = find_candidates(painted((truth, ORANGE)))
    assert iou(only, truth) > 0.93
    assert only.attributes.hole == pytest.approx((25 / 45) ** 2, abs=0.04)
    assert only.attributes.shape == "ring"


def test_the_hole_of_a_broad_frame_is_as_large_as_it_is() -> None:
    whole = box(60, 50, 250, 190)
    truth = whole.difference(box(82, 72, 228, 168))
    (only,) = find_candidates(painted((truth, ORANGE)))
    assert iou(only, truth) > 0.9
    assert only.attributes.hole == pytest.approx(1 - truth.area / whole.area, abs=0.05)


def test_a_wire_ring_is_not_lost_as_a_part_of_itself() -> None:
    truth = disc(160, 120, 80).difference(disc(160, 120, 77))
    found = find_candidates(painted((truth, ORANGE)))
    assert best(found, truth)[0] > 0.75


@pytest.mark.parametrize("band", [10, 22])
def test_a_thing_in_a_frame_and_the_frame_are_two_things(band: int) -> None:
    frame = box(60, 50, 250, 190).difference(box(60 + band, 50 + band, 250 - band, 190 - band))
    inside = disc(150, 120, 30)
    found = find_candidates(painted((frame, ORANGE), (inside, BLUE)))
    assert len(found) == 2
    assert best(found, frame)[0] > 0.85
    assert best(found, inside)[0] > 0.95


def test_a_car_with_its_windows_is_one_thing() -> None:
    car = box(60, 80, 240, 160).buffer(-12).buffer(12)
    windows = [(box(95, 90, 125, 150), (30, 35, 45)), (box(190, 92, 215, 148), (30, 35, 45))]
    (only,) = find_candidates(painted((car, RED), *windows))
    assert iou(only, car) > 0.95
    assert only.attributes.colour == "red"


def test_two_things_that_touch_are_two() -> None:
    one, other = box(60, 80, 150, 170), disc(195, 125, 45)
    found = find_candidates(painted((one, ORANGE), (other, BLUE)))
    assert len(found) == 2
    assert best(found, one)[0] > 0.95
    assert best(found, other)[0] > 0.95


def test_a_cast_shadow_is_no_part_of_the_thing() -> None:
    thing = box(110, 70, 190, 160)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    moved = affinity.translate(thing, 14, 14)
    cast = np.asarray(shapely.contains_xy(moved, x, y), dtype=np.float32)
    dark = 1 - 0.35 * np.asarray(cv2.GaussianBlur(cast, (0, 0), 2))
    shaded = (ground() * dark[..., None]).astype(np.uint8)
    found = find_candidates(painted((thing, ORANGE), on=shaded))
    assert iou(found[0], thing) > 0.94


def test_a_thing_cut_by_the_border_is_found_and_said_to_be() -> None:
    truth = disc(0, 120, 70).intersection(box(-0.5, -0.5, 319.5, 239.5))
    (only,) = find_candidates(painted((truth, ORANGE)))
    assert iou(only, truth) > 0.95
    assert only.attributes.touches_border
    whole = find_candidates(painted((disc(120, 120, 70), ORANGE)))
    assert only.salience < whole[0].salience


def test_bays_between_painted_lines_are_no_things() -> None:
    lines = [(box(20 + 40 * k, 20, 21.5 + 40 * k, 110), WHITE) for k in range(8)]
    car = box(66, 35, 94, 95)
    lot = ground((95, 95, 98))
    assert not [c for c in find_candidates(painted(*lines, on=lot)) if c.outline.area > 500]
    found = find_candidates(painted(*lines, (car, RED), on=lot))
    assert [c.id for c in salient_candidates(found)] == ["c1"]
    assert iou(found[0], car) > 0.93


def test_squares_of_a_cloth_are_no_things_but_what_lies_on_it_is() -> None:
    assert find_candidates(checked(40, (240, 240, 235), (180, 40, 50))) == ()
    woven = checked(24, (205, 200, 190), (190, 184, 174))
    plate = disc(160, 120, 50)
    assert find_candidates(woven) == ()
    (only,) = find_candidates(painted((plate, BLUE), on=woven))
    assert iou(only, plate) > 0.95


@pytest.mark.parametrize("noise", [0.0, 3.0, 6.0])
def test_a_plain_picture_holds_nothing(noise: float) -> None:
    assert find_candidates(ground(noise=noise)) == ()


def test_strong_noise_holds_nothing_that_stands_out() -> None:
    assert len(find_candidates(ground(noise=15.0))) <= 5
    for picture in (ground(noise=40.0), np.random.default_rng(0).integers(0, 256, (*SHAPE, 3))):
        assert all(c.salience < 0.4 for c in find_candidates(picture.astype(np.uint8)))


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (2, 500), (500, 2), (1, 5000), (7, 9)])
def test_tiny_pictures_are_survived(shape: tuple[int, int]) -> None:
    assert find_candidates(np.full((*shape, 3), 130, dtype=np.uint8)) == ()
    noise = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    for found in find_candidates(noise):
        assert box(-1, -1, shape[1], shape[0]).covers(found.outline.polygon)


def test_a_picture_of_40_megapixels_is_measured_in_its_own_pixels() -> None:
    picture = np.full((5000, 8000, 3), GREY, dtype=np.uint8)
    cv2.circle(picture, (3000, 2600), 1100, ORANGE, -1)
    (only,) = find_candidates(picture)
    assert iou(only, disc(3000, 2600, 1100)) > 0.97


def scene_of_three() -> tuple[Pixels, list[Polygon]]:
    things = [disc(70, 70, 34), box(150, 60, 270, 110), Polygon([(60, 210), (130, 210), (95, 150)])]
    return painted(*zip(things, (ORANGE, BLUE, RED), strict=True)), things


def test_ids_count_from_c1_in_the_order_of_salience() -> None:
    found = find_candidates(load_picture(PHOTOS / "images/table_stuff.jpg").pixels)
    assert [c.id for c in found] == [f"c{k}" for k in range(1, len(found) + 1)]
    salience = [c.salience for c in found]
    assert salience == sorted(salience, reverse=True)
    assert len(set(salience)) > 3
    assert all(0 < s <= 1 and type(s) is float for s in salience)


def test_clear_ones_are_the_first_of_them() -> None:
    found = find_candidates(load_picture(PHOTOS / "images/ucm_golfcourse24.jpg").pixels)
    clear = salient_candidates(found)
    assert found[: len(clear)] == clear
    assert 0 < len(clear) < len(found)
    assert salient_candidates(()) == ()


def test_the_same_picture_gives_the_same_candidates() -> None:
    pixels = load_picture(PHOTOS / "images/smarties.png").pixels
    cv2.setRNGSeed(1)
    first = find_candidates(pixels)
    cv2.setRNGSeed(2)
    assert find_candidates(pixels) == first


Move = tuple[Callable[[Pixels], Pixels], Callable[[BaseGeometry], BaseGeometry]]
MOVES: dict[str, Move] = {
    "shifted": (
        lambda p: np.roll(p, (12, 24), axis=(0, 1)),
        lambda g: affinity.translate(g, 24, 12),
    ),
    "mirrored": (
        lambda p: np.ascontiguousarray(p[:, ::-1]),
        lambda g: affinity.affine_transform(g, (-1, 0, 0, 1, SHAPE[1] - 1, 0)),
    ),
    "turned": (
        lambda p: np.ascontiguousarray(np.rot90(p)),
        lambda g: affinity.affine_transform(g, (0, 1, -1, 0, 0, SHAPE[1] - 1)),
    ),
}


@pytest.mark.parametrize("move", list(MOVES))
def test_candidates_move_with_the_picture(move: str) -> None:
    picture, things = scene_of_three()
    move_pixels, move_shape = MOVES[move]
    before, after = find_candidates(picture), find_candidates(move_pixels(picture))
    assert len(before) == len(after) == 3
    for thing in things:
        overlap, old = best(before, thing)
        moved_overlap, new = best(after, move_shape(thing))
        assert min(overlap, moved_overlap) > 0.93
        assert iou(new, move_shape(old.outline.polygon)) > 0.96
        assert new.label == old.label
        assert new.attributes.area == pytest.approx(old.attributes.area, rel=0.03)
