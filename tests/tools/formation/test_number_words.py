"""Numbers as people write and say them: a table, and numbers spelled out read as themselves."""

import pytest
from formup.tools.formation.number_words import SMALL, TENS, numbers_in
from hypothesis import given
from hypothesis import strategies as st

UNITS_OF_TEN = {n: name for name, n in SMALL.items() if name not in ("nought", "naught", "nil")}
NAMES_OF_TENS = {n: name for name, n in TENS.items() if name != "fourty"}


def spelled(number: int, joint: str = "and", hyphen: str = "-") -> str:
    """A number below a million in words."""
    if number < 20:
        return UNITS_OF_TEN[number]
    if number < 100:
        rest = number % 10
        tens = NAMES_OF_TENS[number - rest]
        return f"{tens}{hyphen}{UNITS_OF_TEN[rest]}" if rest else tens
    size, name = (1000, "thousand") if number >= 1000 else (100, "hundred")
    head = f"{spelled(number // size, joint, hyphen)} {name}"
    rest = number % size
    if not rest:
        return head
    return " ".join(
        w for w in (head, joint if rest < 100 else "", spelled(rest, joint, hyphen)) if w
    )


def read(text: str) -> list[tuple[float, float]]:
    return [(n.least, n.most) for n in numbers_in(text)]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("93", 93),
        ("07", 7),
        ("4,310", 4310),
        ("4 310", 4310),
        ("4'310", 4310),
        ("2,000,000", 2_000_000),
        ("12.75", 12.75),
        (".5", 0.5),
        ("5e2", 500),
        ("sixty-three", 63),
        ("sixty three", 63),
        ("a hundred", 100),
        ("three hundred and eleven", 311),
        ("three hundred eleven", 311),
        ("nineteen hundred", 1900),
        ("two thousand and six", 2006),
        ("five thousand four hundred and twenty-one", 5421),
        ("7 thousand", 7000),
        ("one point two five", 1.25),
        ("nought point four", 0.4),
        ("point four", 0.4),
        ("a dozen", 12),
        ("three dozen", 36),
        ("5 dozen", 60),
        ("half a dozen", 6),
        ("one and a half dozen", 18),
        ("three score", 60),
        ("two gross", 288),
        ("a baker's dozen", 13),
        ("six pairs", 12),
        ("a couple", 2),
        ("a trio", 3),
        ("two quartets", 8),
        ("3/8", 0.375),
        ("\u00bc", 0.25),
        ("2\u00bd", 2.5),
        ("four and three quarters", 4.75),
        ("half of 90", 45),
        ("a third of 60", 20),
        ("three quarters of 80", 60),
        ("minus nine", -9),
        ("-9", -9),
        ("\u22129", -9),
        ("15 + 4", 19),
        ("fifteen plus four", 19),
        ("3 \u00d7 7", 21),
        ("3 times 7", 21),
    ],
)
def test_a_number_is_one_number(text: str, value: float) -> None:
    for around in ("{}", "with {} of them", "say {} please"):
        ((least, most),) = read(around.format(text))
        assert (least, most) == (pytest.approx(value), least)


@pytest.mark.parametrize(
    "text", ["4,310, please", "4,310.", pytest.param("4 310, please"), "4 310 !"]
)
def test_a_sign_behind_a_number_is_no_part_of_it(text: str) -> None:
    assert read(text) == [(4310, 4310)]


@pytest.mark.parametrize(
    ("text", "least", "most"),
    [
        ("40-55", 40, 55),
        ("40 \u2013 55", 40, 55),
        ("40 to 55", 40, 55),
        ("forty to fifty-five", 40, 55),
        ("between 40 and 55", 40, 55),
        ("between forty and fifty-five", 40, 55),
        ("7 or 8", 7, 8),
        ("seven or eight", 7, 8),
        ("60 \u00b1 5", 55, 65),
    ],
)
def test_a_range_has_both_ends(text: str, least: float, most: float) -> None:
    assert read(f"with {text} of them") == [(least, most)]
    (number,) = numbers_in(text)
    assert number.whole is None


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("6 on the left and 4 on the right", [6, 4]),
        ("six, two of them at the back", [6, 2]),
        ("5, 6 and 7", [5, 6, 7]),
        ("ten by twelve", [10, 12]),
    ],
)
def test_numbers_that_are_counted_apart_stay_apart(text: str, values: list[float]) -> None:
    assert read(text) == [(v, v) for v in values]


@pytest.mark.parametrize(
    "text",
    [
        "the first",
        "a fifth wheel",
        "the second from the left",
        "seventh heaven",
        "often",
        "weight and height",
        "none",
        "t1 and c3",
        "B52",
        "no hundred",
        "dozens of them",
        "the 2nd",
        "21st century",
        "3D",
        "",
    ],
)
def test_other_words_are_no_numbers(text: str) -> None:
    assert read(text) == []


@pytest.mark.parametrize(
    "text",
    [
        "1,5",
        "0,75",
        "8 200 grams",
        "1.2.3",
    ],
)
def test_no_part_of_a_number_is_taken_for_it(text: str) -> None:
    """What is not read as a whole is no whole number: 1 of "1,5" would be a count of robots."""
    assert not any(n.whole for n in numbers_in(text))


@pytest.mark.parametrize(
    ("text", "whole"),
    [("0", None), ("-4", None), ("2.5", None), ("2.0", 2), ("1e3", 1000), ("half of 12", 6)],
)
def test_counts_are_whole_and_above_0(text: str, whole: int | None) -> None:
    (number,) = numbers_in(text)
    assert number.whole == whole


def test_a_number_stands_where_it_is_said_to_stand() -> None:
    text = "Put three hundred and six robots 2.5 m away, or 40-50."
    assert [text[n.start : n.end] for n in numbers_in(text)] == [
        "three hundred and six",
        "2.5",
        "40-50",
    ]


below_a_million = st.integers(0, 999_999)


@given(below_a_million, st.sampled_from(["and", ""]), st.sampled_from("- "))
def test_a_number_spelled_out_reads_back_as_itself(number: int, joint: str, hyphen: str) -> None:
    text = spelled(number, joint, hyphen)
    assert read(text) == [(number, number)], text
    assert read(text.upper()) == [(number, number)], text


@given(below_a_million)
def test_a_number_in_digits_reads_back_as_itself(number: int) -> None:
    for text in (f"{number}", f"{number:,}", f"{number:,}".replace(",", "\u202f")):
        assert read(text) == [(number, number)], text


@given(st.integers(0, 999), st.lists(st.integers(0, 9), min_size=1, max_size=4))
def test_decimals_in_words_read_back_as_themselves(number: int, digits: list[int]) -> None:
    text = f"{spelled(number)} point {' '.join(UNITS_OF_TEN[d] for d in digits)}"
    value = float(f"{number}.{''.join(map(str, digits))}")
    assert read(text) == [(pytest.approx(value), pytest.approx(value))], text


@given(st.integers(1, 999), st.integers(1, 999), st.booleans())
def test_ranges_and_sums_of_spelled_numbers(low: int, more: int, in_words: bool) -> None:
    first, second = (spelled(n) if in_words else str(n) for n in (low, low + more))
    for text in (f"{first} to {second}", f"between {first} and {second}"):
        assert read(text) == [(low, low + more)], text
    total = low + low + more
    assert read(f"{first} plus {second}") == [(total, total)]


@given(st.integers(2, 999))
def test_dozens_and_halves_of_spelled_numbers(number: int) -> None:
    assert read(f"{spelled(number)} dozen") == [(12 * number, 12 * number)]
    assert read(f"half of {spelled(number)}") == [(number / 2, number / 2)]
    assert read(f"{spelled(number)} and a half") == [(number + 0.5, number + 0.5)]


@given(st.text(max_size=60))
def test_any_text_is_read_without_a_crash(text: str) -> None:
    for number in numbers_in(text):
        assert number.least <= number.most
        assert 0 <= number.start < number.end <= len(text)
