"""Lengths in an instruction, and what each is of: read by the offline rules and by the doubts.

Words that leave open what a length is of make it one of "something"; whoever reads decides then.
"""

import re
from dataclasses import dataclass
from typing import Literal

from .contract import Unit
from .units import in_pixels

Of = Literal["distance", "apart", "across", "radius", "most", "something"]
UNITS: tuple[tuple[str, Unit, float], ...] = (
    (r"px|pixels?", "px", 1.0),
    (r"millimet(?:re|er)s?|mm", "m", 0.001),
    (r"centimet(?:re|er)s?|cm", "m", 0.01),
    (r"met(?:re|er)s?|m", "m", 1.0),
)
"""Spellings, the unit they come to, and how much of it."""
NUMBERS = (
    *("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"),
    *("eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen"),
    *("nineteen", "twenty"),
)
WORDS = {
    **{"half a": 0.5, "half an": 0.5, "a": 1.0, "an": 1.0},
    **{name: float(number) for number, name in enumerate(NUMBERS[:11]) if number},
}
LENGTH = re.compile(
    rf"(?P<number>(?<![\w.,/])(?:[0-9]{{1,3}}(?:,[0-9]{{3}})+|[0-9]+)(?:\.[0-9]+)?|"
    rf"(?<![\w-])(?:{'|'.join(WORDS)}))[\s-]?"
    rf"(?P<unit>\b(?:{'|'.join(u for u, *_ in UNITS)})|"
    rf"(?<=[0-9])(?:{'|'.join(u for u, *_ in UNITS)}))\b(?!\s*(?:/|per\b))"
)
ROBOT = r"(?:robots?|bots?|drones?|rovers?|agents?)"
LEADING = "that|which|are|is|being|measuring|each|of|with|an?"
SIZED = rf"\b(?:{ROBOT}|each|they)(?:\s*[,:]|\s+(?:{LEADING}))*"
BEFORE: tuple[tuple[str, Of], ...] = (
    (rf"(?:{SIZED}\s+|\brobot )(?P<own>radius(?: of| is|\s*:)?\s*)\Z", "radius"),
    (rf"{SIZED}\s+(?P<own>diameter(?: of| is|\s*:)?\s*)\Z", "across"),
    (
        r"(?:\bno two(?: \w+){0,2} (?:closer|nearer) than|\bspac(?:ed|ing)(?: of| by| at|\s*:)?"
        rf"|\bbetween (?:any two |the )?{ROBOT}(?: there)?(?: shall| must)?(?: be|\s*:)?"
        r"|\bfrom the next ?, which is)(?: about| at least)?\s*\Z",
        "apart",
    ),
    (
        r"\b(?:at most|up to|no more than|less than|not more than|within|[0-9]+ (?:and|to|or))"
        r"(?: of| a| an| about)*\s*\Z",
        "most",
    ),
    (r"\b(?:radius|diameter)(?: of| is|\s*:)?\s*\Z", "something"),
    (r"(?:\b(?:minus|not|and a half)|(?<![\w-])-)\s*\Z", "something"),
)
AFTER: tuple[tuple[str, Of], ...] = (
    (r"\A(?: or more)? (?:apart\b|(?:between|from|to) (?:(?:any two |the )?(?:robots|bots|drones)"
     r"|them\b|each other|one another|the next|neighbou?rs))", "apart"),
    (r"\A[\s-]*(?:in )?radius\b", "radius"),
    (r"\A[\s-]*(?:across|wide|in diameter|in size)\b", "across"),
    (r"\A (?:[0-9]|and a half\b)", "something"),
    (r"\A[\s-]*(?:long|high|tall|deep|big|thick|between)\b", "something"),
)  # fmt: skip
"""What stands before and after a length, and what that makes it; those before go first. "own" is
what belongs to the length alone."""
REACH = 80
"""Characters before and after that are looked at."""
TAIL = r"(?: or more)?(?: apart\b)?(?: (?:to|from) (?:each other|one another))?"


@dataclass(frozen=True)
class NamedLength:
    """A length that words name.

    Attributes:
        value: in the unit.
        of: "distance" from the thing, "apart" of robots, "across" or "radius" of a robot, "most"
            where it is an upper bound, "something" that is none of these.
        said: the words for it.
        span: where it stands with the words that say what it is of, from and past-the-end.
    """

    value: float
    unit: Unit
    of: Of
    wording: str
    span: tuple[int, int]

    def px(self, metres_per_pixel: float | None) -> float:
        """In pixels.

        Raises:
            ToolError: metres, and there is no scale.
        """
        return self.value if self.unit == "px" else in_pixels(self.value, "m", metres_per_pixel)


def named_lengths(text: str) -> tuple[NamedLength, ...]:
    """The lengths in px, m, cm or mm that a text names, in its order; lower case is read."""
    return tuple(_named(text, found) for found in LENGTH.finditer(text))


def _named(text: str, found: re.Match[str]) -> NamedLength:
    fitting = [row for row in UNITS if re.fullmatch(row[0], found["unit"])]
    _, unit, factor = fitting[0]
    number = found["number"]
    value = WORDS[number] if number in WORDS else float(number.replace(",", ""))
    of, start, end = _of(text, found.start(), found.end())
    return NamedLength(round(value * factor, 9), unit, of, found[0], (start, end))


def _of(text: str, start: int, end: int) -> tuple[Of, int, int]:
    """What a length at a place is of, and how far the words reach that say so."""
    far = max(start - REACH, 0)
    before, after = text[far:start], text[end : end + REACH]
    for pattern, of in BEFORE:
        wording = re.search(pattern, before)
        if wording:
            own = "own" if "own" in wording.groupdict() else 0
            tail = re.match(TAIL, after) if of == "apart" else None
            return of, far + wording.start(own), end + (tail.end() if tail else 0)
    for pattern, of in AFTER:
        wording = re.search(pattern, after)
        if wording:
            sized = re.search(rf"{SIZED}\s*\Z", before) or re.match(
                rf"\s+{ROBOT}\b", after[wording.end() :]
            )
            meant: Of = of if sized or of not in ("across", "radius") else "something"
            least = re.search(r"\bat least\s*\Z", before) if of == "apart" else None
            return meant, far + least.start() if least else start, end + wording.end()
    return "distance", start, end
