"""Parses numbers and lengths with units in an instruction: "25 dm", "half a metre", "10'"."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from .number_words import PARTS, Number, numbers_in

Kind = Literal["number", "compound", "px", "m", "degrees", "share"]
UNITS: tuple[tuple[str, Kind, float], ...] = (
    (r"px|pixels?", "px", 1.0),
    (r"millimet(?:re|er)s?|mm", "m", 0.001),
    (r"centimet(?:re|er)s?|cms?", "m", 0.01),
    (r"decimet(?:re|er)s?|dm", "m", 0.1),
    (r"kilomet(?:re|er)s?|km", "m", 1000.0),
    (r"met(?:re|er)s?|m", "m", 1.0),
    (r"inch(?:es)?|\"|\u2033", "m", 0.0254),
    (r"foot|feet|ft|'|\u2032", "m", 0.3048),
    (r"yards?|yds?", "m", 0.9144),
    (r"degrees?|deg|\u00b0", "degrees", 1.0),
    (r"per ?cent|%", "share", 0.01),
)
"""Spellings of a unit, the kind of quantity, and the factor to that kind's unit."""
UNIT = re.compile(
    rf"[\s-]*(?:{'|'.join(f'(?P<u{k}>{row[0]})' for k, row in enumerate(UNITS))})"
    r"(?![\w\u00b2\u00b3]|\s*(?:/|per\b))",
    re.IGNORECASE,
)
ONE = re.compile(
    r"\ban?\s+(?:(?:good|full|whole|single)\s+)?"
    r"(?=(?:(?:centi|deci|milli|kilo)?met(?:re|er)|yard|foot|inch|pixel)\b)",
    re.IGNORECASE,
)
AND_PART = re.compile(rf"\s+and\s+(?:a|one)\s+({'|'.join(PARTS)})\b(?!\s+of\b)", re.IGNORECASE)
"""The rest of "a metre and a half"."""
SPLIT = re.compile(
    r"\b([0-9]+)\s?m\s?([0-9]{2})\b(?!\s*(?:px|pixels?|c?m|%|robots?)\b)", re.IGNORECASE
)
"""A length written as "2m50"."""
SHARES_OF = (" a", " an")
"""Endings of numbers that do not count without a unit: "half a circle"."""


@dataclass(frozen=True)
class Quantity:
    """A number with its unit, found in a text.

    Attributes:
        kind: "number" if it has no unit, "compound" in words such as "four-wheeled".
        least, most: the range, in px, m, degrees or as a share; equal if it is not a range.
        wording: the text as written.
        start, end: indices of its first and past-the-last character.
    """

    kind: Kind
    least: float
    most: float
    wording: str
    start: int
    end: int

    @property
    def is_length(self) -> bool:
        """Whether it is a length, in px or metres."""
        return self.kind in ("px", "m")

    @property
    def whole(self) -> int | None:
        """The number if it is whole, above 0, not a range and without a unit; else None."""
        if self.kind not in ("number", "compound"):
            return None
        return Number(self.least, self.most, self.start, self.end).whole

    def px(self, metres_per_pixel: float | None) -> tuple[float, float] | None:
        """Return least and most in pixels; None for metres in a picture without a scale."""
        if self.kind == "px":
            return self.least, self.most
        scale = metres_per_pixel
        return None if scale is None else (self.least / scale, self.most / scale)


def quantities_in(text: str) -> tuple[Quantity, ...]:
    """Return the quantities in a text, in order."""
    found = [_split(m) for m in SPLIT.finditer(text)]
    taken = [(q.start, q.end) for q in found]
    ones = [Number(1.0, 1.0, m.start(), m.end()) for m in ONE.finditer(text)]
    numbers = [n for n in numbers_in(text) if not _overlaps(n, taken)]
    numbers += [n for n in ones if not any(k.start < n.end and n.start < k.end for k in numbers)]
    found += [_with_unit(text, n) for n in numbers if not _overlaps(n, taken)]
    counted = [q for q in found if q.kind != "number" or not q.wording.lower().endswith(SHARES_OF)]
    return _ranges(text, sorted(counted, key=lambda q: q.start))


def _ranges(text: str, found: Sequence[Quantity]) -> tuple[Quantity, ...]:
    """Join quantities that are the two ends of a range, each with its unit: "1 m to 2 m"."""
    ranges: list[Quantity] = []
    for quantity in found:
        last = ranges[-1] if ranges else quantity
        link = text[last.end : quantity.start].strip()
        between = link == "and" and text[: last.start].endswith("between ")
        if last.is_length and last.kind == quantity.kind and (between or link in ("to", "-")):
            start, end = last.start - between * len("between "), quantity.end
            ranges[-1] = Quantity(last.kind, last.least, quantity.most, text[start:end], start, end)
        else:
            ranges.append(quantity)
    return tuple(ranges)


def _overlaps(number: Number, taken: list[tuple[int, int]]) -> bool:
    return any(number.start < end and start < number.end for start, end in taken)


def _split(match: re.Match[str]) -> Quantity:
    value = int(match[1]) + int(match[2]) / 100
    return Quantity("m", value, value, match[0], match.start(), match.end())


def _with_unit(text: str, number: Number) -> Quantity:
    end = number.end
    unit = UNIT.match(text, end)
    if unit is None:
        compound = re.match(r"-[^\W\d_]", text[end:]) is not None
        wording = text[number.start : end].rstrip()
        end = number.start + len(wording)
        kind: Kind = "compound" if compound else "number"
        return Quantity(kind, number.least, number.most, wording, number.start, end)
    row = next(k for k in range(len(UNITS)) if unit[f"u{k}"])
    _, kind, factor = UNITS[row]
    more, end = 0.0, unit.end()
    if number.least == number.most and (part := AND_PART.match(text, end)):
        more, end = 1 / PARTS[part[1].lower()], part.end()
    least, most = (round((value + more) * factor, 9) for value in (number.least, number.most))
    return Quantity(kind, least, most, text[number.start : end], number.start, end)
