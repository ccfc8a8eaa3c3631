"""Outlined letters are the font's: as Pillow draws it, simple rings, and beside each other."""

import numpy as np
import pytest
import shapely
from formup.tools.errors import InputError
from formup.tools.geometry.figures.typeface import letter_outlines
from formup.tools.geometry.outline import CORNER_TURN, FloatArray
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter, ImageFont

PRINTING = "".join(map(chr, range(33, 127)))
SIZE = 400
SCALE = SIZE / 1000
BASE = (100, SIZE)


def drawn_by_pillow(text: str) -> NDArray[np.bool_]:
    image = Image.new("L", (3 * SIZE, 3 * SIZE // 2), 0)
    face = ImageFont.load_default(SIZE)
    ImageDraw.Draw(image).text(BASE, text, 255, face, anchor="ls")
    return np.asarray(image) > 127


def filled(rings: tuple[FloatArray, ...]) -> NDArray[np.bool_]:
    """What lies within an odd number of rings, drawn at SIZE."""
    image = np.zeros((3 * SIZE // 2, 3 * SIZE), dtype=bool)
    for ring in rings:
        one = Image.new("1", (3 * SIZE, 3 * SIZE // 2), 0)
        ImageDraw.Draw(one).polygon([(x, y) for x, y in (ring * SCALE + BASE).tolist()], fill=1)
        image ^= np.asarray(one)
    return image


def widened(mask: NDArray[np.bool_], by: int) -> NDArray[np.bool_]:
    grown = Image.fromarray(mask.astype(np.uint8) * 255).filter(ImageFilter.MaxFilter(2 * by + 1))
    return np.asarray(grown) > 0


@pytest.mark.parametrize("text", [*PRINTING, "A y", "fi"])
def test_outlines_are_those_that_pillow_draws(text: str) -> None:
    ours, theirs = filled(letter_outlines(text)), drawn_by_pillow(text)
    assert ours.any()
    assert not (ours & ~widened(theirs, 2)).any()
    assert not (theirs & ~widened(ours, 2)).any()


@pytest.mark.parametrize("character", PRINTING)
def test_a_glyph_is_simple_rings_that_part_an_inside(character: str) -> None:
    rings = [shapely.LinearRing(ring) for ring in letter_outlines(character)]
    assert all(ring.is_simple and ring.is_closed for ring in rings)
    assert not any(a.intersects(b) for i, a in enumerate(rings) for b in rings[:i])


def test_curves_have_no_corners() -> None:
    for ring in letter_outlines("Oo0"):
        steps = np.diff(np.concatenate([ring, ring[1:2]]), axis=0)
        heading = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        assert np.abs(np.diff(heading)).max() < CORNER_TURN


def test_letters_stand_in_a_row_with_their_blanks() -> None:
    one, apart = letter_outlines("AB"), letter_outlines(" A  B ")
    assert np.allclose(apart[0], one[0])
    assert (apart[-1] - one[-1])[:, 0].min() > 300
    assert max(ring[:, 0].max() for ring in one[:2]) < one[-1][:, 0].min()


@pytest.mark.parametrize("text", ["", "  ", "\u00d6", "A\n", "\u4e00"])
def test_what_the_font_lacks_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="ASCII"):
        letter_outlines(text)
