"""Numbered candidates: a person must be able to tell which number means which thing."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import shapely
from formup.tools.draw import draw_look
from formup.tools.draw.canvas import MARKS, Canvas, Colour, Labels
from formup.tools.draw.numbered import colours_of, draw_numbered
from formup.tools.draw.rulers import RULER
from formup.tools.geometry.outline import FloatArray, largest_part, outline_of
from formup.tools.perception.detectors.candidates import find_candidates
from formup.tools.perception.image import Picture, load_picture, picture_from_array
from formup.tools.perception.referring.attributes import Attributes, Candidate
from formup.tools.world import Target, World
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage
from shapely.geometry import LineString, Point, Polygon
from shapely.geometry.base import BaseGeometry

PHOTOS = Path(__file__).parents[3] / "evals/photos/images"


def candidate(number: int, polygon: BaseGeometry) -> Candidate:
    outline = outline_of(polygon)
    centre = (polygon.centroid.x, polygon.centroid.y)
    seen = Attributes(
        colours=(("grey", 1.0),),
        lab=(50.0, 0.0, 0.0),
        area=outline.area,
        centre=centre,
        orientation=0.0,
        elongation=1.0,
        roundness=1.0,
        shapes=(("circle", 1.0),),
        hole=0.0,
        touches_border=False,
    )
    return Candidate(f"c{number}", outline, seen, 1.0)


def numbered(*polygons: BaseGeometry) -> tuple[NDArray[np.bool_], NDArray[np.uint8]]:
    """Where candidates changed the picture, and the picture, at 4 px per pixel of it."""
    picture = picture_from_array(np.full((200, 300, 3), 120, dtype=np.uint8))
    world = World.of(picture)
    candidates = [candidate(k, p) for k, p in enumerate(polygons, start=1)]
    pixels = photograph_of(draw_look(picture, world, candidates=candidates))
    return (pixels != photograph_of(draw_look(picture, world))).any(axis=2), pixels


def photograph_of(look: Image.Image) -> NDArray[np.uint8]:
    """A look without its rulers."""
    left, top, right, bottom = RULER
    return np.asarray(look)[top:-bottom, left:-right]


def chip_of(pixels: NDArray[np.uint8], colour: tuple[int, int, int]) -> tuple[float, float]:
    """Middle of the largest blot of a colour, in pixels of the 300 x 200 picture."""
    same = (pixels == colour).all(axis=2)
    labels, _ = ndimage.label(ndimage.binary_opening(same, iterations=3))
    sizes = np.bincount(labels.ravel())[1:]
    rows, columns = np.nonzero(labels == 1 + int(np.argmax(sizes)))
    return (columns.min() + columns.max()) / 8, (rows.min() + rows.max()) / 8


def test_a_number_stands_in_a_large_thing_and_beside_a_small_one() -> None:
    large, small = shapely.box(30, 30, 130, 130), shapely.box(200, 90, 206, 96)
    changed, pixels = numbered(large, small)
    x, y = chip_of(pixels, MARKS[0])
    assert (x, y) == pytest.approx((80, 80), abs=1)
    x, y = chip_of(pixels, MARKS[1])
    assert 4 < shapely.Point(x, y).distance(small) < 12
    assert not changed[4 * 92 : 4 * 95, 4 * 202 : 4 * 205].any()  # it stays in sight


def test_a_number_keeps_off_smaller_things_inside_and_out_of_holes() -> None:
    plate, coin = Point(100, 100).buffer(60), Point(100, 100).buffer(12)
    _, pixels = numbered(plate, coin)
    x, y = chip_of(pixels, MARKS[0])
    assert plate.contains(Point(x, y))
    assert Point(x, y).distance(coin) > 3
    ring = Point(100, 100).buffer(60).difference(Point(100, 100).buffer(35))
    _, pixels = numbered(ring)
    x, y = chip_of(pixels, MARKS[0])
    assert ring.contains(Point(x, y))
    changed, _ = numbered(ring)
    assert changed[4 * 100, 4 * 134 : 4 * 137].any()  # the hole's edge is drawn


def test_neighbours_differ_in_colour() -> None:
    row = [Point(20 + 20 * k, 100).buffer(8) for k in range(14)]
    colours = colours_of([outline_of(p) for p in row])
    for k in range(13):
        assert colours[k] not in colours[max(k - 3, 0) : k]


class Recording(Canvas):
    """A canvas that remembers where its chips are, page px."""

    chips: list[Polygon]

    def chip(
        self,
        where: FloatArray,
        text: str,
        size: float,
        colour: Colour,
        ground: Colour,
        seam: float = 0.0,
    ) -> None:
        half = np.array(self.chip_size(text, size)) / 2
        (x0, y0), (x1, y1) = (where - half).tolist(), (where + half).tolist()
        self.chips.append(Polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]))
        super().chip(where, text, size, colour, ground, seam)


def parking_lot() -> tuple[Picture, Sequence[Candidate]]:
    picture = load_picture(PHOTOS / "ucm_parkinglot26.jpg")
    return picture, find_candidates(picture.pixels)[:40]


def grid_of_dots() -> tuple[Picture, Sequence[Candidate]]:
    picture = picture_from_array(np.full((200, 300, 3), 90, dtype=np.uint8))
    dots = [Point(20 + 36 * i, 24 + 36 * j).buffer(5) for j in range(5) for i in range(8)]
    return picture, [candidate(k, p) for k, p in enumerate(dots, start=1)]


@pytest.mark.parametrize("crowd", [parking_lot, grid_of_dots])
def test_numbers_in_a_crowd_hide_neither_each_other_nor_a_thing(
    crowd: Callable[[], tuple[Picture, Sequence[Candidate]]],
) -> None:
    picture, candidates = crowd()
    assert len(candidates) > 25
    canvas = Recording(picture, 1200, 1.0)
    canvas.chips = []
    colours = colours_of([c.outline for c in candidates])
    draw_numbered(canvas, candidates, colours, Labels(canvas.photo))
    chips = canvas.chips
    assert len(chips) == len(candidates)
    for k, chip in enumerate(chips):
        assert sum(chip.intersection(other).area for other in chips[:k]) < 0.1 * chip.area
        assert shapely.box(*canvas.photo).buffer(1).contains(chip)
    taken = shapely.union_all(chips)
    for found in candidates:
        shape = shapely.transform(found.outline.polygon, canvas.at)
        assert shape.intersection(taken).area < 0.6 * shape.area


def test_candidates_at_the_very_edge_and_of_odd_shape() -> None:
    comb = shapely.union_all(
        [shapely.box(0, 0, 299, 2), *(shapely.box(x, 0, x + 1, 190) for x in range(0, 300, 9))]
    )
    thread = LineString([(0, 199), (150, 100), (299, 199)]).buffer(0.6)
    speck = shapely.box(297, 197, 299.4, 199.4)
    changed, pixels = numbered(largest_part(comb) or speck, thread, speck)
    assert changed.any()
    for colour in MARKS[:3]:
        x, y = chip_of(pixels, colour)
        assert 2 < x < 298
        assert 2 < y < 198


def test_targets_and_candidates_share_no_colour() -> None:
    picture = picture_from_array(np.full((200, 300, 3), 120, dtype=np.uint8))
    outline = outline_of(shapely.box(20, 20, 90, 90))
    target = Target(
        id="t1", label="thing", box=outline.bounds, confidence=0.9, outline=outline, prompt="box"
    )
    found = candidate(1, shapely.box(150, 20, 220, 90))
    image = draw_look(picture, World.of(picture, targets=(target,)), candidates=[found])
    halves = np.split(photograph_of(image), [4 * 120], axis=1)
    for half, own, other in zip(halves, MARKS[:2], MARKS[1::-1], strict=True):
        assert (half == own).all(axis=2).sum() > 1000
        assert not (half == other).all(axis=2).any()
