"""Colour names of pixels: the basic terms, shares, and doubt where two terms meet."""

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from formup.tools.perception.referring.attributes import ColourName
from formup.tools.perception.referring.colours import colour_shares, lab_of
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

TYPICAL: list[tuple[ColourName, str]] = [
    ("red", "d62020"),
    ("red", "a01818"),
    ("orange", "f58020"),
    ("yellow", "f8dc20"),
    ("green", "30a040"),
    ("green", "406838"),
    ("blue", "2050d0"),
    ("blue", "80b8e0"),
    ("purple", "7030a0"),
    ("pink", "f090b0"),
    ("brown", "704020"),
    ("black", "141416"),
    ("grey", "8c8c8c"),
    ("grey", "58585c"),
    ("white", "f4f4f2"),
]
BETWEEN: list[tuple[ColourName, ColourName, str]] = [
    ("red", "orange", "e84a10"),
    ("orange", "yellow", "ffba00"),
    ("grey", "white", "cecece"),
    ("black", "grey", "2e2e2e"),
]


def painted(*colours: str, count: int = 40) -> npt.NDArray[np.uint8]:
    """As many pixels of every colour, (n, 3)."""
    each = [np.frombuffer(bytes.fromhex(colour), np.uint8) for colour in colours]
    return np.repeat(np.stack(each), count, axis=0)


@pytest.mark.parametrize(("name", "colour"), TYPICAL)
def test_typical_colours_have_their_names(name: ColourName, colour: str) -> None:
    best, share = colour_shares(painted(colour))[0]
    assert best == name
    assert share > 0.6


@pytest.mark.parametrize(("one", "other", "colour"), BETWEEN)
def test_a_colour_between_two_names_is_partly_both(
    one: ColourName, other: ColourName, colour: str
) -> None:
    shares = dict(colour_shares(painted(colour)))
    assert shares[one] > 0.15
    assert shares[other] > 0.15
    assert shares[one] + shares[other] > 0.7


@given(arrays(np.uint8, st.tuples(st.integers(1, 50), st.just(3))))
def test_shares_of_any_pixels_add_up_to_one_largest_first(rgb: npt.NDArray[np.uint8]) -> None:
    shares = colour_shares(rgb)
    assert sum(share for _, share in shares) == pytest.approx(1, abs=1e-4)
    assert all(one[1] >= other[1] for one, other in pairwise(shares))
    assert len(shares) == len({name for name, _ in shares}) == 11


def test_half_red_and_half_blue_is_half_each() -> None:
    shares = dict(colour_shares(painted("c81e1e", "2040c8")))
    assert shares["red"] == pytest.approx(0.5, abs=0.05)
    assert shares["blue"] == pytest.approx(0.5, abs=0.05)


def test_shares_are_those_of_the_pixels_in_any_order() -> None:
    rgb = painted("c81e1e", "2040c8", "2040c8", "f4f4f2")
    mixed = np.random.default_rng(0).permutation(rgb)
    for (one, share), (other, again) in zip(colour_shares(rgb), colour_shares(mixed), strict=True):
        assert one == other
        assert share == pytest.approx(again, abs=1e-5)


def test_lab_is_that_of_the_standard() -> None:
    """CIE 1976 values of sRGB's corners under D65, as published."""
    rgb = painted("000000", "ffffff", "ff0000", "0000ff", count=1)
    known = [(0, 0, 0), (100, 0, 0), (53.24, 80.09, 67.20), (32.30, 79.19, -107.86)]
    assert lab_of(rgb) == pytest.approx(np.array(known), abs=0.3)
