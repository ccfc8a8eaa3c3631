"""Lengths in words: how long, in which unit, and of what."""

import re

import pytest
from formup.tools.formation.named_lengths import named_lengths

THREE = [
    ("keep {} from it", "distance"),
    ("stay at least {} away", "distance"),
    ("distance from the object: {}.", "distance"),
    ("6 robots, {} apart", "apart"),
    ("spaced {} apart", "apart"),
    ("no two robots closer than {} to each other.", "apart"),
    ("at least {} between robots.", "apart"),
    ("between any two robots there shall be at least {}.", "apart"),
    ("robots {} wide", "across"),
    ("the robots are {} across.", "across"),
    ("6 robots, each {} in diameter", "across"),
    ("robots with a diameter of {}", "across"),
    ("robots: {} in diameter.", "across"),
    ("{} wide robots", "across"),
    ("robots of radius {}", "radius"),
    ("spacing: {}", "apart"),
    ("distance between robots: at least {}", "apart"),
    ("each keeps away from the next, which is {} or more", "apart"),
    ("at most {} away", "most"),
    ("10 to {}", "most"),
    ("the {} long boat", "something"),
    ("the {} wide pool", "something"),
    ("on a circle of radius {}", "something"),
]


@pytest.mark.parametrize(("template", "of"), THREE)
@pytest.mark.parametrize(
    ("wording", "value", "unit"),
    [
        ("12 px", 12, "px"),
        ("1.5 m", 1.5, "m"),
        ("40cm", 0.4, "m"),
        ("2 metres", 2, "m"),
        ("1,500 mm", 1.5, "m"),
        ("two meters", 2, "m"),
    ],
)
def test_what_a_length_is_of(template: str, of: str, wording: str, value: float, unit: str) -> None:
    text = template.format(wording)
    (found,) = named_lengths(text)
    (apart,) = named_lengths(re.sub(r"([,:])", r" \1", template).format(wording))  # words apart
    assert (apart.value, apart.of) == (value, of)
    assert (found.value, found.unit, found.of, found.wording) == (value, unit, of, wording)
    assert wording in text[slice(*found.span)]
    assert found.px(0.5) == (value if unit == "px" else value / 0.5)


@pytest.mark.parametrize(
    "text", ["6 robots", "20 square metres", "5 cm per px", "2 m/s", "5 min", "a mm2"]
)
def test_what_is_no_length(text: str) -> None:
    assert named_lengths(text) == ()


def test_a_half_and_several() -> None:
    lengths = named_lengths("half a metre from it, robots 40 cm wide, no two closer than 2 m")
    assert [(n.value, n.of) for n in lengths] == [(0.5, "distance"), (0.4, "across"), (2, "apart")]
