"""Lengths, angles and shares with their units, and what is none of them."""

import pytest
from formup.tools.formation.quantities import Kind, quantities_in
from hypothesis import given
from hypothesis import strategies as st


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("35 px", "px", 35),
        ("35px", "px", 35),
        ("35-pixel", "px", 35),
        ("thirty-five pixels", "px", 35),
        ("two dozen pixels", "px", 24),
        ("2.4 m", "m", 2.4),
        ("2.4 METRES", "m", 2.4),
        ("one meter", "m", 1),
        ("a metre", "m", 1),
        ("half a metre", "m", 0.5),
        ("a metre and a half", "m", 1.5),
        ("two yards and a quarter", "m", 2.0574),
        ("a good metre", "m", 1.0),
        ("three quarters of a metre", "m", 0.75),
        ("two and a half metres", "m", 2.5),
        ("1\u00bd m", "m", 1.5),
        ("3m25", "m", 3.25),
        ("3 m 25", "m", 3.25),
        ("180 cm", "m", 1.8),
        ("18 dm", "m", 1.8),
        ("1,800 mm", "m", 1.8),
        ("1.2 km", "m", 1200),
        ("9 feet", "m", 2.7432),
        ("9'", "m", 2.7432),
        ("30 inches", "m", 0.762),
        ('30"', "m", 0.762),
        ("four yards", "m", 3.6576),
        ("30 degrees", "degrees", 30),
        ("30\u00b0", "degrees", 30),
        ("15 %", "share", 0.15),
        ("fifteen per cent", "share", 0.15),
        ("minus 12 px", "px", -12),
        ("12 + 9 px", "px", 21),
        ("half of 70 px", "px", 35),
        ("3 x 1.5 m", "m", 4.5),
        ("12", "number", 12),
        ("twelve robots", "number", 12),
        ("three-legged", "compound", 3),
    ],
)
def test_one_quantity_with_its_unit(text: str, kind: Kind, value: float) -> None:
    (quantity,) = quantities_in(f"Stand {text} away")
    assert (quantity.kind, quantity.least) == (kind, pytest.approx(value))
    assert quantity.most == quantity.least
    assert quantity.is_length == (kind in ("px", "m"))


@pytest.mark.parametrize(
    ("text", "kind", "least", "most"),
    [
        ("15-25 px", "px", 15, 25),
        ("between 15 and 25 px", "px", 15, 25),
        ("fifteen to twenty-five pixels", "px", 15, 25),
        ("1.5 to 2 m", "m", 1.5, 2),
        ("20 \u00b1 2 cm", "m", 0.18, 0.22),
        ("15 px to 25 px", "px", 15, 25),
        ("between 1 m and 2 m", "m", 1, 2),
    ],
)
def test_a_unit_is_of_both_ends_of_a_range(
    text: str, kind: Kind, least: float, most: float
) -> None:
    (quantity,) = quantities_in(text)
    assert (quantity.kind, quantity.least, quantity.most) == (
        kind,
        pytest.approx(least),
        pytest.approx(most),
    )
    assert quantity.whole is None


@pytest.mark.parametrize(
    "text", ["5 m/s", "5 metres per second", "5 m\u00b2", "5 cm\u00b3", "5 miles", "5 magnets"]
)
def test_other_units_make_no_length(text: str) -> None:
    (quantity,) = quantities_in(text)
    assert quantity.kind == "number"
    assert quantity.wording == "5"


@pytest.mark.parametrize(
    "text",
    [
        "a circle",
        "half a circle",
        "the metre rule",
        pytest.param("an inchworm"),
        pytest.param("a centre piece"),
        pytest.param("a footpath"),
    ],
)
def test_words_without_a_number_name_no_quantity(text: str) -> None:
    assert quantities_in(text) == ()


def test_pixels_of_metres_take_a_scale() -> None:
    metres, pixels = quantities_in("2 to 3 m or 40 px")
    assert metres.px(0.05) == (pytest.approx(40), pytest.approx(60))
    assert metres.px(None) is None
    assert pixels.px(None) == pixels.px(0.05) == (40, 40)


def test_a_quantity_is_quoted_as_it_is_written() -> None:
    text = "Ring it with Twenty-Two robots, 1 m 20 away, 30\u00b0 turned"
    found = quantities_in(text)
    assert [q.wording for q in found] == ["Twenty-Two", "1 m 20", "30\u00b0"]
    assert [text[q.start : q.end] for q in found] == [q.wording for q in found]


SPELLINGS: dict[str, tuple[Kind, float]] = {
    " px": ("px", 1),
    " pixels": ("px", 1),
    " m": ("m", 1),
    " metres": ("m", 1),
    " cm": ("m", 0.01),
    " feet": ("m", 0.3048),
    " degrees": ("degrees", 1),
    " %": ("share", 0.01),
}


@given(st.integers(0, 99_999), st.integers(0, 99), st.sampled_from(sorted(SPELLINGS)))
def test_a_number_with_its_unit_reads_back(whole: int, hundredths: int, unit: str) -> None:
    value = whole + hundredths / 100
    kind, factor = SPELLINGS[unit]
    (quantity,) = quantities_in(f"they stand {value}{unit} from it")
    assert (quantity.kind, quantity.least) == (kind, pytest.approx(value * factor))


@given(st.integers(1, 500), st.integers(1, 500), st.sampled_from(sorted(SPELLINGS)))
def test_ranges_with_a_unit_read_back(low: int, more: int, unit: str) -> None:
    kind, factor = SPELLINGS[unit]
    for text in (f"{low}-{low + more}{unit}", f"between {low} and {low + more}{unit}"):
        (quantity,) = quantities_in(text)
        assert quantity.kind == kind
        assert quantity.least == pytest.approx(low * factor)
        assert quantity.most == pytest.approx((low + more) * factor)


@given(st.text(max_size=60))
def test_any_text_is_read_without_a_crash(text: str) -> None:
    for quantity in quantities_in(text):
        assert text[quantity.start : quantity.end].strip() == quantity.wording.strip()
