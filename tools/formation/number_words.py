"""Numbers as people write and say them: "78", "a hundred and twenty", "two and a half dozen".

No maintained library reads dozens, halves, fractions and "a hundred" and gives their position in
the text (text2num, the best of those tried, reads plain cardinals only).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

SMALL = {
    name: number
    for number, name in enumerate(
        [
            "zero",
            "one",
            "two",
            "three",
            "four",
            "five",
            "six",
            "seven",
            "eight",
            "nine",
            "ten",
            "eleven",
            "twelve",
            "thirteen",
            "fourteen",
            "fifteen",
            "sixteen",
            "seventeen",
            "eighteen",
            "nineteen",
        ]
    )
} | {"nought": 0, "naught": 0, "nil": 0}
TENS = {
    name: 10 * number
    for number, name in enumerate(
        ["twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety"], start=2
    )
} | {"fourty": 40}
SCALES = {"hundred": 100, "thousand": 1_000, "million": 1_000_000}
GROUPS = {"dozen": 12, "score": 20, "pair": 2, "couple": 2, "gross": 144, "trio": 3, "quartet": 4}
"""Nouns that multiply a number: "three pairs of robots" are six."""
PARTS = {"half": 2, "third": 3, "quarter": 4, "fifth": 5, "sixth": 6, "eighth": 8, "tenth": 10}
SIGNS = {"\u00bd": 0.5, "\u00bc": 0.25, "\u00be": 0.75, "\u2153": 1 / 3, "\u2154": 2 / 3}
DIGITS = (
    r"[0-9]{1,3}(?:[,\u00a0\u2009\u202f'][0-9]{3})+(?:\.[0-9]+)?|"
    r"[0-9]{1,3}(?: [0-9]{3})+(?![0-9]|[.,][0-9])|"
    r"[0-9]+,[0-9]{1,2}(?![0-9])|[0-9]*\.?[0-9]+(?:e[0-9]+)?"
)
WEIGHED = (
    r"[0-9]{1,3}(?: [0-9]{3})+(?=[ -]?(?:k?g|k?grams?|kilos?|pounds?|lbs?|oz|ounces?|v|volts?)\b)"
)
"""A weight or voltage after a count, which is not one number: "8 200 gram robots" are eight."""
ATOM = re.compile(
    rf"(?P<weighed>(?<![\w.,]){WEIGHED})|"
    rf"(?P<digits>(?<![\w.,])(?:{DIGITS})(?!\d|(?:st|nd|rd|th|d)\b))|(?P<sign>[\u00bd\u00bc\u00be\u2153\u2154])|"
    r"(?P<word>[^\W\d_]+(?:'s)?)|(?P<mark>[-\u2013\u2014\u2212+*\u00d7/\u00b1%,.;:!?()'\"])",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Number:
    """A number or range of numbers found in a text.

    Attributes:
        least, most: the number twice, or the ends of a range.
        start, end: indices of its first and past-the-last character.
    """

    least: float
    most: float
    start: int
    end: int

    @property
    def whole(self) -> int | None:
        """The number if it is whole, above 0 and not a range, as a count is; else None."""
        value = round(self.least)
        exact = abs(value - self.least) < 1e-9 and self.most == self.least
        return value if exact and value > 0 else None


@dataclass(frozen=True)
class _Atom:
    text: str
    kind: str
    start: int
    end: int


def numbers_in(text: str) -> tuple[Number, ...]:
    """Return the numbers in a text in order, each read as far as it extends.

    Ordinals, "no one" and "the one" are not numbers. Sums, products and fractions of a number give
    one number; "20-30", "between 20 and 30" and "25 \u00b1 2" give a range.
    """
    atoms = [_Atom(m[0].lower(), str(m.lastgroup), m.start(), m.end()) for m in ATOM.finditer(text)]
    found: list[Number] = []
    at = 0
    while at < len(atoms):
        read = _expression(atoms, at)
        if read is None:
            at += 1
            continue
        found.append(read[0])
        at = read[1]
    return tuple(found)


def _expression(atoms: Sequence[_Atom], at: int) -> tuple[Number, int] | None:
    """Parse a number with its sign and what is joined to it by arithmetic or as a range."""
    read = _joined(atoms, at, bridging=True)
    if read is not None and _text(atoms, at) == "between" and read[0].least == read[0].most:
        return (
            _joined(atoms, at, bridging=False) or read
        )  # "between a hundred and a hundred and one"
    return read


def _joined(atoms: Sequence[_Atom], at: int, *, bridging: bool) -> tuple[Number, int] | None:
    """Parse as `_expression` does; `bridging` allows "and" within the first number."""
    start = at
    negative = _text(atoms, at) in ("minus", "-", "\u2212") and _begins(atoms, at)
    between = _text(atoms, at) == "between"
    first = _quantity(atoms, at + (negative or between), bridging=bridging)
    if first is None:
        return None
    value, at = first
    low = high = -value if negative else value
    while (joined := _text(atoms, at)) and not negative:
        second = _quantity(atoms, at + 1)
        if second is None:
            break
        other, after = second
        if joined in ("+", "plus"):
            low, high = low + other, high + other
        elif joined in ("*", "\u00d7", "x", "times"):
            low, high = low * other, high * other
        elif joined == "\u00b1":
            low, high = low - other, high + other
        elif joined in ("-", "\u2013", "\u2014", "to") or (joined == "and" and between):
            low, high = min(low, other), max(high, other)
        elif joined == "or" and other > high:
            high = other
        else:
            break
        at = after
    if between and low == high:
        start += 1
    return Number(low, high, atoms[start].start, atoms[at - 1].end), at


def _begins(atoms: Sequence[_Atom], at: int) -> bool:
    """Return whether a sign is a minus: "minus", or next to the number and to nothing before it."""
    if atoms[at].text == "minus":
        return True
    close = at + 1 < len(atoms) and atoms[at].end == atoms[at + 1].start
    return close and (at == 0 or atoms[at - 1].end < atoms[at].start)


def _quantity(
    atoms: Sequence[_Atom], at: int, *, bridging: bool = True
) -> tuple[float, int] | None:
    """Parse a number with its fraction, times the dozens, scores or pairs that it counts."""
    if _text(atoms, at) in ("a", "an") and _text(atoms, at + 1) == "baker's":
        return (13.0, at + 3) if _text(atoms, at + 2) == "dozen" else None
    share = _share(atoms, at)
    if share is not None:
        return share
    read = _number(atoms, at, bridging=bridging)
    if read is None:
        noun = _text(atoms, at + 1)
        if _text(atoms, at) in ("a", "an") and noun in GROUPS and noun != "score":
            return float(GROUPS[noun]), at + 2 + (_text(atoms, at + 2) == "of")
        return None
    value, at = read
    value, at = _and_a_half(atoms, value, at)
    noun = _text(atoms, at).removesuffix("s") if _text(atoms, at) != "gross" else "gross"
    if noun in GROUPS:
        value, at = value * GROUPS[noun], at + 1
        at += _text(atoms, at) == "of"
    return value, at


def _share(atoms: Sequence[_Atom], at: int) -> tuple[float, int] | None:
    """Parse a fraction: half a dozen, half of 40, two thirds of a (metre), three quarters of an."""
    count, k = 1.0, at
    if _text(atoms, k) in ("a", "an", "one") and _text(atoms, k + 1) in PARTS:
        k += 1
    elif _text(atoms, k) in SMALL and _text(atoms, k + 1).removesuffix("s") in PARTS:
        count, k = float(SMALL[_text(atoms, k)]), k + 1
    name = _text(atoms, k)
    part = PARTS.get(name) or PARTS.get(name.removesuffix("s")) or (2 if name == "halves" else None)
    if part is None or (k == at and name != "half"):
        return None
    share, k = count / part, k + 1
    joined = _text(atoms, k) == "of"
    k += joined
    if _text(atoms, k) in ("a", "an"):
        noun = _text(atoms, k + 1)
        return (share * GROUPS[noun], k + 2) if noun in GROUPS else (share, k + 1)
    whole = _number(atoms, k) if joined else None
    return (share * whole[0], whole[1]) if whole else None


def _and_a_half(atoms: Sequence[_Atom], value: float, at: int) -> tuple[float, int]:
    if _text(atoms, at) == "and":
        share = _text(atoms, at + 2).removesuffix("s")
        if _text(atoms, at + 1) in ("a", "one") and share in PARTS:
            return value + 1 / PARTS[share], at + 3
        if _text(atoms, at + 1) in SMALL and share in PARTS:
            return value + SMALL[_text(atoms, at + 1)] / PARTS[share], at + 3
    if at < len(atoms) and atoms[at].kind == "sign":
        return value + SIGNS[atoms[at].text], at + 1
    return value, at


def _number(atoms: Sequence[_Atom], at: int, *, bridging: bool = True) -> tuple[float, int] | None:
    """Parse digits, a fraction in digits, or a cardinal in words with its decimals."""
    if at >= len(atoms):
        return None
    atom = atoms[at]
    if atom.kind == "sign":
        return SIGNS[atom.text], at + 1
    if atom.text == "point" and _text(atoms, at - 1) not in ("the", "a", "each", "that", "this"):
        value, end = _after_point(atoms, 0.0, at)
        return (value, end) if end > at else None
    if atom.kind == "digits":
        decimal = re.fullmatch(r"[0-9]+,[0-9]{1,2}", atom.text)  # as in much of Europe
        plain = atom.text.replace(",", ".") if decimal else atom.text
        value = float(re.sub(r"[^0-9.e]", "", plain))
        if _text(atoms, at + 1) == "/" and at + 2 < len(atoms) and atoms[at + 2].kind == "digits":
            below = float(re.sub(r"[^0-9.e]", "", atoms[at + 2].text))
            return (value / below, at + 3) if below else None
        scale = SCALES.get(_text(atoms, at + 1))
        return (value * scale, at + 2) if scale else (value, at + 1)
    return _cardinal(atoms, at, bridging)


def _cardinal(atoms: Sequence[_Atom], at: int, bridging: bool) -> tuple[float, int] | None:
    """Parse a cardinal in words: four hundred and twenty-one; one point five."""
    total, current, k = 0, 0, at
    if _text(atoms, k) in ("a", "an") and _text(atoms, k + 1) in SCALES:
        current, k = 1, k + 1
    while k < len(atoms):
        word = _text(atoms, k)
        if word in SCALES and word != "hundred" and current:
            total, current = total + current * SCALES[word], 0
        elif (more := _grown(current, word)) is not None:
            current = more
        elif not _bridges(atoms, k, bridging and (bool(total) or current % 100 == 0), k > at):
            break
        k += 1
    return None if k == at else _after_point(atoms, float(total + current), k)


def _grown(current: int, word: str) -> int | None:
    """Extend a number below a thousand by one more word; None if the word does not fit."""
    if word == "hundred":
        return current * 100 if 0 < current < 100 else None
    if word in TENS:
        return current + TENS[word] if current % 100 == 0 else None
    value = SMALL.get(word)
    if value is None or (current and value == 0):
        return None
    fits = current % 10 == 0 if value < 10 else current % 100 == 0
    return current + value if fits else None


def _bridges(atoms: Sequence[_Atom], at: int, whole: bool, begun: bool) -> bool:
    """Return whether "and" or a hyphen joins what follows to the number before it."""
    if not begun or not _next_counts(atoms, at):
        return False
    word = _text(atoms, at)
    return (word == "and" and whole) or (word == "-" and _is_joined(atoms, at))


def _after_point(atoms: Sequence[_Atom], value: float, at: int) -> tuple[float, int]:
    """Return the number with its decimals, if "point" and digits in words follow."""
    if _text(atoms, at) != "point" or _text(atoms, at + 1) not in SMALL:
        return value, at
    at, scale = at + 1, 0.1
    while SMALL.get(_text(atoms, at), 10) < 10:
        value, scale, at = value + SMALL[_text(atoms, at)] * scale, scale / 10, at + 1
    return round(value, 9), at


def _next_counts(atoms: Sequence[_Atom], at: int) -> bool:
    return _text(atoms, at + 1) in (*SMALL, *TENS)


def _is_joined(atoms: Sequence[_Atom], at: int) -> bool:
    return atoms[at - 1].end == atoms[at].start and atoms[at].end == atoms[at + 1].start


def _text(atoms: Sequence[_Atom], at: int) -> str:
    return atoms[at].text if 0 <= at < len(atoms) else ""
