"""Words to an arrangement, by rules: phrases of vocabulary.yaml, found in the instruction.

Not a language model and not meant to look like one: what the phrases do not settle is left
open, and the planner asks.
"""

import re
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, get_args

import yaml

from ...tools.formation.named_lengths import NamedLength, Of, named_lengths

GAP = 6
"""Words that "..." may stand for."""
ASIDE = re.compile(
    r"(?<!so )\b(?:that|which|who)\s+(?:is|are|was|were|has|have|lies?|stands?|sits?|hangs?|looks?"
    r"|leans?|can|could|would|will|you|runs?)\b[^,.;:!?]*"
)
"""A relative clause says which thing is meant, not what to do with it."""
QUESTION = re.compile(
    r"(?:^|(?<=[.!?;]))\s*(?:what|why|who|how|where|when|which|should|shall|may|isn't|aren't|are|is|was|were|does|did|has|have)"
    r"\b[^.!?;]*\?"
)
"""A question is no instruction, unlike "could you surround it?"."""
ENDINGS = ("ing", "ed", "es", "s", "e")
Words = list[str]


@dataclass(frozen=True)
class Reading:
    """What was understood; `relations` with more or fewer than one entry settles nothing.

    Lengths are px: the distance to keep, the least distance of robots' centres, a robot's radius.
    `unscaled` are metric lengths that a picture without a scale says nothing of; `beyond` has them
    too.
    """

    relations: tuple[str, ...]
    robots: int | None
    odd_count: str | None
    side: str | None
    layout: str
    fit: str
    spacing: str
    clearance: float | None
    min_spacing: float | None
    robot_radius: float | None
    unscaled: tuple[str, ...]
    beyond: tuple[str, ...]
    escape_proof: bool


def understand(instruction: str, metres_per_pixel: float | None = None) -> Reading:
    """Read an instruction in English about a picture of a scale, if it has one."""
    lengths = _Lengths(instruction, metres_per_pixel)
    spoken = lengths.cut("apart", "across", "radius")
    words = _without_ignored(_stems(ASIDE.sub(" ", QUESTION.sub(" ", spoken))))
    side = next(iter(_matches("sides", words)), None)
    relations = _unbeaten(_matches("relations", words))
    if not relations:
        relations = ["along"] if side else _matches("weak", words)
    numbers = lengths.cut(*get_args(Of))
    robots, odd = _count(numbers)
    return Reading(
        relations=tuple(relations),
        robots=robots,
        odd_count=odd,
        side=side if "along" in relations else None,
        layout=next(iter(_matches("layout", words)), "line"),
        fit=next(iter(_matches("fit", words)), "normal"),
        spacing="free" if any(_found(p, words) for p in _vocabulary()["free"]) else "even",
        clearance=lengths.of("distance"),
        min_spacing=lengths.of("apart"),
        robot_radius=lengths.radius,
        unscaled=lengths.unscaled,
        beyond=(*_beyond(words, relations, side), *lengths.beyond, *_foreign_units(numbers)),
        escape_proof=any(_found(p, words) for p in _vocabulary()["escape_proof"]),
    )


class _Lengths:
    """What an instruction's lengths come to in px.

    Attributes:
        unscaled: metric ones that need a scale there is none of.
        beyond: these, and those that say what the rules do not carry out.
    """

    def __init__(self, instruction: str, metres_per_pixel: float | None) -> None:
        self._text = instruction.lower()
        self._named = named_lengths(self._text)
        metric = () if metres_per_pixel else [n for n in self._named if n.unit == "m"]
        self.unscaled = tuple(n.wording for n in metric)
        loose = [n for n in self._named if n not in metric and n.of in ("most", "something")]
        known = [n for n in self._named if n not in metric and n not in loose]
        self._px: dict[Of, list[float]] = {}
        for length in known:
            self._px.setdefault(length.of, []).append(length.px(metres_per_pixel))
        several = [n for n in known if len(set(self._px[n.of])) > 1]
        self.beyond = (*self.unscaled, *(self._whole(n) for n in (*loose, *several)))

    @property
    def radius(self) -> float | None:
        """Of a robot; half of what it is across."""
        across = self.of("across")
        return self.of("radius") if across is None else across / 2

    def of(self, what: Of) -> float | None:
        """The length that is of that."""
        return next(iter(self._px.get(what, ())), None)

    def cut(self, *of: Of) -> str:
        """The text, lower case, without the words for such lengths."""
        text = self._text
        for length in reversed(self._named):
            if length.of in of:
                start, end = length.span
                text = f"{text[:start]} , {text[end:]}"
        return text

    def _whole(self, length: NamedLength) -> str:
        return self._text[slice(*length.span)]


@cache
def _vocabulary() -> dict[str, Any]:
    text = resources.files(__package__ or "").joinpath("vocabulary.yaml").read_text("utf-8")
    return yaml.safe_load(text)


def _stems(text: str) -> Words:
    return [_stem(word) for word in re.findall(r"[a-z']+|[0-9.]+|[;!?]", text.lower())]


def _stem(word: str) -> str:
    for ending in ENDINGS:
        if word.endswith(ending) and len(word) - len(ending) >= 3:
            return word[: -len(ending)]
    return word


def _matches(kind: str, words: Words) -> list[str]:
    """Keys of a vocabulary table of which some phrase is in the words."""
    table: dict[str, list[str]] = _vocabulary()[kind]
    return [key for key, phrases in table.items() if any(_found(p, words) for p in phrases)]


def _found(phrase: str, words: Words) -> tuple[int, int] | None:
    """Where a phrase stands in the words: first and past-the-last index."""
    parts = [[_stem(w) for w in part.split()] for part in phrase.split(" ... ")]
    for start in range(len(words)):
        end = start
        for i, part in enumerate(parts):
            reach = range(end, end + 1 if i == 0 else min(end + GAP + 1, len(words)))
            at = next((k for k in reach if words[k : k + len(part)] == part), None)
            if at is None or any(w in ";!?" for w in words[end:at]):
                break
            end = at + len(part)
        else:
            return start, end
    return None


def _without_ignored(words: Words) -> Words:
    for phrase in _vocabulary()["ignore"]:
        while (place := _found(phrase, words)) is not None:
            words = words[: place[0]] + words[place[1] :]
    return words


def _unbeaten(relations: list[str]) -> list[str]:
    beats: dict[str, list[str]] = _vocabulary()["beats"]
    beaten = {loser for r in relations for loser in beats.get(r, [])}
    return [r for r in relations if r not in beaten]


def _count(text: str) -> tuple[int | None, str | None]:
    """A number of robots in the words, or what stands there but is none."""
    lowered = text.lower()
    number = rf"(?<![\w.])-?[0-9][0-9,.]*|{number_words()}"
    nouns = "|".join(rf"{noun}s?" for noun in _vocabulary()["robots"] if noun != "one")
    found = re.search(
        rf"({number}|\bmany|\bseveral|\bsome)(?:\s+[a-z-]+)?\s*(?:{nouns})\b", lowered
    ) or re.search(
        rf"\b(?:use|with|by)\s+({number})\b|^\s*({number})\s+(?:around|along|inside|between)",
        lowered,
    )
    if re.search(r"\b(?:each|every)\b.*corner", lowered):  # "one robot at each": not one in all
        found = re.search(rf"({number})\s+corners?", lowered)
    loose = _loose_count(lowered, number, nouns)
    if loose is not None:
        return None, loose
    if found is None:
        return None, None
    word = next(group for group in found.groups() if group)
    value = whole_number(word.strip())
    return (value, None) if value is not None else (None, found[0].strip())


def _loose_count(text: str, number: str, nouns: str) -> str | None:
    """Words that leave the number open: 6 to 8 robots, more than six robots, 3 + 4 robots."""
    joined = r"\s*(?:to|or|plus|but|,?\s*no,?|[+*x/])\s*"
    several = rf"(?:{number})(?:{joined})+(?:{number})\s+(?:{nouns})\b"
    digits = rf"[0-9]+\s*[-\u2013]\s*[0-9]+\s+(?:{nouns})\b"
    bound = rf"\b(?:(?:more|fewer|less) than|not)\s+(?:{number})\b(?!\s*px|\s*pixel)"
    share = rf"(?:{number})\s*(?:%|percent\b)"
    found = re.search(rf"{digits}|{several}|{bound}|{share}", text)
    return found[0].strip() if found else None


def number_words() -> str:
    """A pattern for a number in words."""
    names = "|".join(_vocabulary()["numbers"])
    return rf"\bhalf\s+a\s+dozen\b|\b(?:{names})(?:[\s-]+(?:{names}))*\b"


def whole_number(word: str) -> int | None:
    """Digits, or words that multiply and add up: four hundred, twenty-five, half a dozen."""
    if re.fullmatch(r"[0-9]+|[0-9]{1,3}(?:,[0-9]{3})+", word):
        return int(word.replace(",", ""))
    if word.startswith("half"):
        return 6
    total = 0
    for part in re.findall(r"[a-z]+", word):
        value = _vocabulary()["numbers"].get(part)
        if value is None:
            return None
        total = total * value if value >= 100 or (part == "dozen" and total) else total + value
    return total or None


def _beyond(words: Words, relations: list[str], side: str | None) -> tuple[str, ...]:
    """What the words also say that these rules do not carry out."""
    found = _matches("beyond", words)
    straight = [s for s in _matches("sides", words) if s in ("left", "right", "top", "bottom")]
    if "along" in relations and len(straight) > 1:
        found.append(f"the {' and the '.join(straight)} side at once")
    if side and any(r in ("inside", "around", "cage") for r in relations):
        found.append(f"the {side} side of it")
    return tuple(found)


def _foreign_units(text: str) -> list[str]:
    """Lengths that are not read: in other units, such as 3 feet, or amounts such as fifty px."""
    units = "|".join(_vocabulary()["units"])
    amount = rf"(?:[0-9][0-9.,/]*(?:e[0-9]+)?|\u00bd|{number_words()}|\bhalf\s+an?|\ban?)"
    spoken = rf"{amount}[\s-]*(?:{units})s?\b|\b[a-z-]+[\s-]+(?:pixels?|px|met(?:re|er)s?|km)\b"
    return re.findall(spoken, text.lower())
