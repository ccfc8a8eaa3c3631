"""Shape classes of polygons drawn here, turned, moved, scaled and mirrored at will."""

import math

import numpy as np
import pytest
import shapely
from formup.tools.perception.referring.attributes import ShapeName
from formup.tools.perception.referring.shape_classes import shape_fits
from hypothesis import given
from hypothesis import strategies as st
from shapely import affinity
from shapely.geometry import Point, Polygon, box


def disc(radius: float) -> Polygon:
    return Point(0, 0).buffer(radius, 32)


def without(whole: Polygon, part: Polygon) -> Polygon:
    rest = whole.difference(part)
    assert isinstance(rest, Polygon)
    return rest


def joined(*parts: Polygon) -> Polygon:
    whole = shapely.union_all(parts)
    assert isinstance(whole, Polygon)
    return whole


def spikes(count: int, inner: float) -> Polygon:
    """A star; with `inner` 1 a regular polygon of twice as many corners."""
    turns = [math.pi * k / count for k in range(2 * count)]
    reach = [1.0 if k % 2 else inner for k in range(2 * count)]
    return Polygon([(r * math.cos(t), r * math.sin(t)) for r, t in zip(reach, turns, strict=True)])


def regular(count: int) -> Polygon:
    return Polygon(list(spikes(count, 1.0).exterior.coords)[:-1:2])


def heart() -> Polygon:
    """Two discs on the upper sides of a square that stands on its corner."""
    square = affinity.rotate(box(-1, -1, 1, 1), 45)
    side = math.sqrt(0.5)
    lobes = [affinity.translate(disc(1), x * side, side) for x in (-1, 1)]
    return joined(square, *lobes)


def blob(seed: int, rough: float) -> Polygon:
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * np.arange(180) / 180
    waves = [rng.normal(0, rough) * np.cos(k * turn + rng.uniform(0, 6)) for k in range(2, 7)]
    reach = np.exp(np.sum(waves, axis=0))
    return Polygon(np.stack([reach * np.cos(turn), reach * np.sin(turn)], axis=1))


DRAWN: list[tuple[ShapeName, Polygon]] = [
    ("circle", disc(1)),
    ("oval", affinity.scale(disc(1), 1.9, 1)),
    ("square", box(0, 0, 1, 1)),
    ("rectangle", box(0, 0, 1.8, 1)),
    ("rectangle", box(0, 0, 4.2, 1)),
    ("triangle", Polygon([(0, 0), (1, 0), (0.5, 0.75)])),
    ("triangle", Polygon([(0, 0), (1, 0), (0.2, 1.2)])),
    ("pentagon", regular(5)),
    ("hexagon", regular(6)),
    ("star", spikes(5, 0.45)),
    ("star", spikes(6, 0.55)),
    ("cross", joined(box(-0.3, -1, 0.3, 1), box(-1, -0.3, 1, 0.3))),
    ("L", joined(box(0, 0, 1.1, 0.45), box(0, 0, 0.45, 1))),
    ("T", joined(box(0, 0, 1, 0.3), box(0.35, 0, 0.65, 1))),
    ("C", without(box(0, 0, 1, 1), box(0.26, 0.26, 1, 0.74))),
    ("C", without(without(disc(1), disc(0.55)), box(0, -0.48, 2, 0.48))),
    ("arrow", joined(box(-1, -0.2, 0.3, 0.2), Polygon([(0.2, -0.6), (1, 0), (0.2, 0.6)]))),
    ("ring", without(disc(1), disc(0.6))),
    ("frame", without(box(-1, -1, 1, 1), box(-0.6, -0.6, 0.6, 0.6))),
    ("crescent", without(disc(1), affinity.translate(disc(1), 0.55, 0))),
    ("heart", heart()),
]
NAMES = [f"{name}{k}" for k, (name, _) in enumerate(DRAWN)]


@pytest.mark.parametrize(("name", "polygon"), DRAWN, ids=NAMES)
@given(
    turn=st.floats(0, 360),
    size=st.floats(3, 500),
    at=st.tuples(st.floats(-1e3, 5e3), st.floats(-1e3, 5e3)),
    mirrored=st.booleans(),
)
def test_a_class_stays_itself_however_it_lies(
    name: ShapeName,
    polygon: Polygon,
    turn: float,
    size: float,
    at: tuple[float, float],
    mirrored: bool,
) -> None:
    lying = affinity.rotate(polygon, turn)
    lying = affinity.scale(lying, -size if mirrored else size, size, origin=(0, 0))
    fits = shape_fits(affinity.translate(lying, *at))
    assert fits[0][0] == name
    # Clearly so: what another class has is less by more than pixels can move it.
    assert fits[0][1] > fits[1][1] + 0.01


@given(st.integers(0, 10_000), st.floats(0.02, 0.5), st.floats(0.05, 1))
def test_fits_are_shares_and_sorted(seed: int, rough: float, flat: float) -> None:
    fits = shape_fits(affinity.scale(blob(seed, rough), 40, 40 * flat))
    values = [value for _, value in fits]
    assert all(0 <= value <= 1 for value in values)
    assert values == sorted(values, reverse=True)
    assert len({name for name, _ in fits}) == len(fits)


def test_what_was_drawn_fits_its_own_class_perfectly() -> None:
    for polygon in (disc(30), box(0, 0, 20, 20), box(0, 0, 40, 20)):
        best = shape_fits(polygon)[0][1]
        assert 0.97 < best <= 1


def test_blobs_are_irregular() -> None:
    shapes = [shape_fits(blob(seed, 0.25))[0][0] for seed in range(60)]
    assert shapes.count("irregular") >= 45


def test_an_irregular_thing_fits_no_class_well() -> None:
    fits = shape_fits(blob(3, 0.35))
    assert fits[0][0] == "irregular"


def test_a_hole_makes_a_disc_a_ring_and_a_square_a_frame() -> None:
    assert shape_fits(disc(50))[0][0] == "circle"
    assert shape_fits(without(disc(50), disc(25)))[0][0] == "ring"
    assert shape_fits(box(0, 0, 50, 50))[0][0] == "square"
    assert shape_fits(without(box(0, 0, 50, 50), box(10, 10, 40, 40)))[0][0] == "frame"


def test_a_ring_is_no_frame() -> None:
    ring = dict(shape_fits(without(disc(50), disc(30))))
    frame = dict(shape_fits(without(box(0, 0, 50, 50), box(10, 10, 40, 40))))
    assert ring["ring"] > ring["frame"] + 0.05
    assert frame["frame"] > frame["ring"] + 0.05


def test_a_speck_as_long_as_a_line_is_survived() -> None:
    assert shape_fits(box(0, 0, 3000, 1))[0][0] == "irregular"
