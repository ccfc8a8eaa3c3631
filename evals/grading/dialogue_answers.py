"""Check that a sentence has the numbers it must have, each computed on true outlines."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from .dialogue_forms import gaps_around
from .dialogue_states import Case, distances_to

_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:,\d{3})*(?:\.\d+)?")
_NO = re.compile(r"\b(?:no|not|isn't|open)\b", re.IGNORECASE)
PX, SHARE = 3.0, 0.15


def says(case: Case, wanted: Mapping[str, Any]) -> Iterator[str]:
    """Yield what the message lacks of what it must contain.

    number: that number; robots: how many there are; distance: how far a robot is from its thing;
    gap: the widest; nearest: the robot nearest to a thing; closed: yes or no; words: these, in
    upper or lower case.
    """
    text = case.after.message
    numbers = [float(n.replace(",", "")) for n in _NUMBER.findall(text)]
    for name, value in wanted.items():
        if name == "words":
            missing = [word for word in value if word.lower() not in text.lower()]
            if missing:
                yield f"{missing[0]!r} is not in {text!r}"
        elif name == "closed":
            if bool(_NO.search(text)) == value:
                yield f"it is {'closed' if value else 'open'}, told: {text!r}"
        elif name == "nearest":
            if not {float(robot) for robot in _nearest(case, value)} & set(numbers):
                yield f"robot {' or '.join(_nearest(case, value))} is nearest, told: {text!r}"
        else:
            length = _lengths(case, name, value)
            if not any(
                _matches(number, length, case.scale, exact=name not in LENGTHS)
                for number in numbers
            ):
                yield f"{length:.1f} is not in {text!r}"


LENGTHS = ("distance", "gap")


def _matches(number: float, right: float, scale: float | None, *, exact: bool) -> bool:
    """Return whether a number is the right one: a length in px, or in metres if there's a scale."""
    if exact:
        return abs(number - right) < 1e-6
    near = [abs(number - right) <= max(PX, SHARE * right)]
    if scale is not None:
        near.append(abs(number - right * scale) <= max(PX * scale, SHARE * right * scale))
    return any(near)


def _lengths(case: Case, name: str, value: Any) -> float:
    state = case.after
    if name == "distance":
        return float(case.distances(state)[list(state.robots).index(str(value))])
    if name == "gap":
        return max(float(gaps_around(t, points).chords.max()) for t, points in case.rings())
    return float(len(state.robots)) if name == "robots" else float(value)


def _nearest(case: Case, thing: str) -> list[str]:
    """Return the robots nearest to a thing, with ties within the slack of an outline."""
    far = distances_to(case.things[thing], case.after.positions)
    return [r for r, d in zip(case.after.robots, far, strict=True) if d <= np.min(far) + PX]
