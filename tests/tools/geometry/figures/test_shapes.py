"""Drawn shapes: their strokes hold together, robots stand on them evenly, any way they lie."""

import math

import numpy as np
import pytest
import shapely
from formup.tools.errors import InputError
from formup.tools.geometry.figures.letters import letter_strokes, stroke_glyphs
from formup.tools.geometry.figures.shapes import (
    Sketch,
    arc_sketch,
    fitted,
    grid_sketch,
    line_sketch,
    polygon_sketch,
    polyline_sketch,
    star_sketch,
)
from formup.tools.geometry.figures.strokes import split_at_crossings, spread, stretches
from formup.tools.geometry.figures.typeface import letter_outlines
from formup.tools.geometry.outline import FloatArray, distances
from formup.tools.geometry.sampling import min_spacing
from hypothesis import given, settings
from hypothesis import strategies as st

FEW = settings(derandomize=True, deadline=None, max_examples=40)
BOX = (100.0, 80.0, 540.0, 400.0)
SKETCHES = {
    "line": line_sketch(upright=True),
    "arc": arc_sketch(180, 300),
    "circle": arc_sketch(),
    "hexagon": polygon_sketch(6),
    "star": star_sketch(5),
    "UP": polyline_sketch(*letter_strokes("UP")),
    "go 42": polyline_sketch(*letter_strokes("go 42")),
    "R8 in outline": polyline_sketch(*letter_outlines("R8")),
    "zigzag": polyline_sketch(np.array([(0.0, 0), (30, 40), (60, 0), (90, 40), (20, 20)])),
}
NECK = {"R8 in outline": 25.0}
"""Where a shape runs beside itself: how near, px, in BOX."""
WALKS = {"A": 4, "E": 3, "H": 5, "I": 1, "K": 5, "O": 1, "P": 2, "Q": 3, "T": 3, "X": 4, "Y": 3,
         "4": 3, "6": 2, "8": 2, "9": 2}  # fmt: skip


def lines_of(sketch: Sketch) -> shapely.MultiLineString:
    return shapely.MultiLineString([shapely.LineString(line) for line in sketch.lines])


@pytest.mark.parametrize("glyph", stroke_glyphs())
@pytest.mark.parametrize("height", [3.0, 97.3, 4000.0])
def test_a_letter_is_in_one_piece_wherever_it_lies(glyph: str, height: float) -> None:
    drawn = fitted(
        polyline_sketch(*letter_strokes(glyph)), (11.3, 7.7, 11.3 + height, 7.7 + height)
    )
    parts = split_at_crossings(drawn.lines)
    assert len(parts) == WALKS.get(glyph, len(split_at_crossings(letter_strokes(glyph))))
    joined = shapely.union_all([shapely.LineString(p).buffer(height / 1000) for p in parts])
    assert joined.geom_type == "Polygon"
    assert sum(shapely.LineString(p).length for p in parts) == pytest.approx(
        shapely.union_all(lines_of(drawn)).length, rel=0.01
    )


def test_every_letter_looks_like_itself_alone() -> None:
    """No two glyphs lie within a fifth of the height of each other's lines all along."""
    drawn = {
        g: lines_of(fitted(polyline_sketch(*letter_strokes(g)), (0, 0, 100, 100)))
        for g in stroke_glyphs()
    }
    alike = {
        (a, b)
        for a, one in drawn.items()
        for b, other in drawn.items()
        if a < b and shapely.hausdorff_distance(one, other, densify=0.05) < 8
    }
    assert alike <= {("0", "O")}


@pytest.mark.parametrize("text", ["", "  ", "Ö", "A!"])
def test_what_has_no_strokes_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="A to Z"):
        letter_strokes(text)


@pytest.mark.parametrize("name", SKETCHES)
@pytest.mark.parametrize("n", [1, 2, 3, 5, 9, 24, 100, 700])
def test_robots_stand_on_the_lines_and_no_gap_is_much_wider_than_another(name: str, n: int) -> None:
    drawn = fitted(SKETCHES[name], BOX)
    points = spread(drawn.lines, n)
    length = sum(shapely.LineString(w).length for w in split_at_crossings(drawn.lines))
    assert points.shape == (n, 2)
    assert distances(lines_of(drawn), points).max() < 0.1
    if n >= 24:
        assert max(s.length for s in stretches(drawn.lines, points, 0.2)) <= 1.6 * length / n
        assert min_spacing(points) > 0.3 * min(length / n, NECK.get(name, length))


@pytest.mark.parametrize("n", [10, 24, 60])
def test_ends_and_corners_come_first(n: int) -> None:
    star, word = fitted(star_sketch(5), BOX), fitted(polyline_sketch(*letter_strokes("LT")), BOX)
    tips = star.lines[0][:-1]
    ends = np.array([word.lines[0][0], word.lines[0][1], word.lines[0][2], word.lines[2][1]])
    for corners, lines in ((tips, star.lines), (ends, word.lines)):
        points = spread(lines, n)
        away = np.linalg.norm(points[:, None] - corners[None], axis=2).min(axis=0)
        assert away.max() < 0.1


def moved(points: FloatArray, angle: float, scale: float, mirror: bool) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    turned = points * np.array([-1.0 if mirror else 1.0, 1.0]) @ np.array([[c, s], [-s, c]])
    return turned * scale + np.array([40.0, -7.0])


@given(
    st.sampled_from(sorted(SKETCHES)), st.integers(1, 60), st.floats(0, 6.3),
    st.floats(0.1, 30), st.booleans(),
)  # fmt: skip
@FEW
def test_a_shape_turned_enlarged_or_mirrored_is_drawn_as_evenly(
    name: str, n: int, angle: float, scale: float, mirror: bool
) -> None:
    drawn = fitted(SKETCHES[name], BOX)
    other = tuple(moved(line, angle, scale, mirror) for line in drawn.lines)

    def gaps(lines: tuple[FloatArray, ...], size: float) -> list[float]:
        found = stretches(lines, spread(lines, n), 0.2 * size)
        return sorted((s.length / size for s in found), reverse=True)

    one, two = gaps(drawn.lines, 1.0), gaps(other, scale)
    fewest = len([g for g in one if g > 1])
    assert len([g for g in two if g > 1]) == fewest
    assert one[:fewest] == pytest.approx(two[:fewest], abs=0.5)


@given(st.integers(1, 300), st.integers(1, 20))
@FEW
def test_a_grid_has_all_its_places_once_in_rows(n: int, rows: int) -> None:
    if rows > n:
        with pytest.raises(InputError, match="rows"):
            grid_sketch(n, rows)
        return
    places = grid_sketch(n, rows).places
    assert places is not None
    assert len(np.unique(places, axis=0)) == n
    assert len(np.unique(places[:, 1])) <= rows
    assert min_spacing(places) >= 1


@pytest.mark.parametrize("name", SKETCHES)
def test_fitted_into_a_box_it_lies_in_it_and_touches_it(name: str) -> None:
    x0, y0, x1, y1 = fitted(SKETCHES[name], BOX).frame
    assert x0 >= BOX[0] - 1e-9
    assert y0 >= BOX[1] - 1e-9
    assert x1 <= BOX[2] + 1e-9
    assert y1 <= BOX[3] + 1e-9
    assert (x1 - x0) == pytest.approx(440) or (y1 - y0) == pytest.approx(320)


def test_a_box_without_extent_holds_nothing() -> None:
    with pytest.raises(InputError, match="holds no such shape"):
        fitted(star_sketch(5), (3, 3, 3, 9))
