"""The words of a follow-up as phrases of known kinds: robots, things, amounts, directions, fillers.

Every word is in one phrase. A phrase may be of several kinds, as "left" is a direction and a side;
the frame that takes it decides. A word of no kind is "unknown", so that the person is asked.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import yaml

from ...tools.formation.number_words import SMALL
from ...tools.formation.quantities import Quantity, quantities_in
from .descriptions import Description
from .followup_chunks import Chunk, in_context
from .lexicon import fillers
from .phrases import HEADS, table
from .phrases import phrase as thing_phrase
from .standing import Standing

WORD = re.compile(
    r"\b[tc][0-9]{1,4}\b|[^\W\d_]+(?:['\u2019][^\W\d_]+)*|[0-9]+(?:[.,][0-9]+)*|[^\w\s]"
)
POINT = re.compile(
    r"\(?\b(-?[0-9]+(?:\.[0-9]+)?) ?[,/] ?(-?[0-9]+(?:\.[0-9]+)?)\)?(?![0-9%]|\.[0-9]| ?px)"
)
NAMED = re.compile(r"\b[tc][0-9]{1,4}\b")
NUMBERED = re.compile(
    r"#? ?([0-9]{1,5})\b(?! ?(?:px|pix|m\b|met|cm|mm|%|per|deg|\u00b0|ft|feet|inch))"
)
ARTICLES = frozenset(("the", "a", "an"))
NOT_PLACING = frozenset(("to", "of", "about", "each", "every"))
EACH, PART = ("one", "ones"), ("even", "odd")
PRONOUNS = frozenset(("them", "it", "they", "us", "you"))
SIDE_WORDS = ("left", "right", "top", "bottom", "upper", "lower", "leftmost", "rightmost", "middle")


@dataclass(frozen=True)
class _Word:
    text: str
    start: int
    end: int


def chunks_of(text: str, standing: Standing) -> tuple[Chunk, ...]:
    """Return the phrases of a text, in order."""
    lowered = re.sub(r"(?<=[a-z])-(?=[a-z])", " ", text.lower().replace("\u2019", "'"))
    words = [_Word(m[0], m.start(), m.end()) for m in WORD.finditer(lowered)]
    points = list(POINT.finditer(lowered))
    amounts = [
        q for q in quantities_in(text) if q.wording.lower() not in ("half", "third", "quarter")
    ]
    reader = _Reader(lowered, words, points, amounts, standing)
    found: list[Chunk] = []
    at = 0
    while at < len(words):
        chunk, at = reader.read(at)
        found.append(chunk)
    return tuple(in_context(found, standing))


class _Reader:
    """Reads one phrase after another."""

    def __init__(
        self,
        text: str,
        words: Sequence[_Word],
        points: Sequence[re.Match[str]],
        amounts: Sequence[Quantity],
        standing: Standing,
    ) -> None:
        self.text, self.words, self.standing = text, words, standing
        self.points, self.amounts = points, amounts
        self.plain = [w.text for w in words]

    def read(self, at: int) -> tuple[Chunk, int]:
        """Return the longest phrase that begins at a word, and the index of the word after it."""
        known, end = self._known(at)
        readings = [
            self._point(at),
            self._named(at),
            self._robots(at),
            self._amount(at),
            self._thing(at),
        ]
        best = max((r for r in readings if r), key=lambda r: r[1], default=None)
        if best is not None and best[1] > end:
            kinds, end = best
        elif best is not None and best[1] == end:
            kinds = {**best[0], **known} if "thing" not in best[0] else known
        elif end > at:
            kinds = known
        else:
            kinds, end = {"unknown": self.words[at].text}, at + 1
        return Chunk(kinds, self.words[at].start, self.words[end - 1].end), end

    def _known(self, at: int) -> tuple[dict[str, Any], int]:
        """Return the longest phrase of followups.yaml and its end; articles in it are ignored."""
        found: dict[str, Any] = {}
        end, spoken, k = at, list[str](), at
        while k < len(self.words) and len(spoken) < longest():
            if self.plain[k] not in ARTICLES or k == at:
                spoken.append(self.plain[k])
                kinds = lexicon().get(
                    tuple(w for w in spoken if w not in ARTICLES) or tuple(spoken)
                )
                if kinds:
                    found, end = kinds, k + 1
            k += 1
        new = self.plain[at] in ("a", "an") and "relation" in found  # "a V", not "the V"
        return {k: v for k, v in found.items() if not (new and k == "team")}, end

    def _until(self, at: int, end: int) -> int:
        """Return the index of the first word at or after a position in the text."""
        return next(
            (k for k in range(at, len(self.words)) if self.words[k].start >= end), len(self.words)
        )

    def _point(self, at: int) -> tuple[dict[str, Any], int] | None:
        match = next((m for m in self.points if m.start() == self.words[at].start), None)
        if match is None:
            return None
        return {"point": (float(match[1]), float(match[2]))}, self._until(at, match.end())

    def _named(self, at: int) -> tuple[dict[str, Any], int] | None:
        match = NAMED.match(self.text, self.words[at].start)
        if match is None:
            return self._in_order(at)
        return {"thing": match[0]}, self._until(at, match.end())

    def _in_order(self, at: int) -> tuple[dict[str, Any], int] | None:
        """Read an ordinal among several known things: "the second", "the first thing"."""
        start = at + (self.plain[at] in ARTICLES)
        if start >= len(self.plain):
            return None
        place, things = table_of("ordinals").get(self.plain[start]), self.standing.things
        named = self.plain[start + 1 : start + 2]
        end = start + 1 + (named in (["one"], ["thing"], ["object"]))
        placing = word_set("before_things") - NOT_PLACING | {"for"}
        led = at > 0 and self.plain[at - 1] in placing  # "at the first"
        after = {*lexicon().get(tuple(named), ())}
        idle = not named or not named[0][0].isalpha() or {"filler", "sep"} & after
        plain = end == start + 1 and (start == at or not idle)
        first = self.plain[start] == "first" and named not in (["thing"], ["object"])
        first = first and not led and bool(self.standing.plan)  # else there is no first plan
        if place is None or first or plain or not 1 < len(things) >= place:
            return None
        return {"thing": things[place - 1 if place > 0 else -1][0]}, end

    def _robots(self, at: int) -> tuple[dict[str, Any], int] | None:
        """Read named robots: robot 3; robots 3, 4 and 5; r7; the third robot."""
        after = self.plain[at + 1] if at + 1 < len(self.plain) else ""
        place = table_of("ordinals").get(self.plain[at])
        if place is not None and after in word_set("robots"):
            return {"robots": (place if place > 0 else len(self.standing.robots),)}, at + 2
        if self.plain[at] == "the" and after in (*table_of("ordinals"), *word_set("robots"), *PART):
            return self._robots(at + 1)
        if self.plain[at] in ("every", *PART):
            return self._every(at)
        if self.plain[at] not in word_set("robots"):
            return None
        numbers: list[int] = []
        end = k = at + 1 + (after in ("number", "nr", "no") and self.plain[at] != "number")
        while k < len(self.words):
            number = self._number(k)
            if number is None:
                break
            spanned = numbers and self.plain[k - 1] in ("to", "-", "through")
            if spanned and not self.plain[at].endswith("s"):
                break
            numbers += range(numbers[-1] + 1, number + 1) if spanned else [number]
            end = self._until(k, self._number_end(k))
            k = end
            while k < len(self.words) and self.plain[k] in (
                "and",
                ",",
                "&",
                "to",
                "-",
                "robot",
                "nr",
                "#",
            ):
                k += 1
        return ({"robots": tuple(numbers)}, end) if numbers else None

    def _every(self, at: int) -> tuple[dict[str, Any], int] | None:
        """Read every second robot, every third one, the odd ones."""
        every, rank = self.plain[at] == "every", "".join(self.plain[at + 1 : at + 2])
        step = 2 if not every or rank == "other" else table_of("ordinals").get(rank, 0)
        end = at + 1 + every
        end += self.plain[end : end + 1] == ["numbered"]
        if step < 2 or self.plain[end : end + 1] not in [[w] for w in (*EACH, *word_set("robots"))]:
            return None
        first = step if self.plain[at] != "odd" else 1
        return {"robots": tuple(map(int, self.standing.robots[first - 1 :: step]))}, end + 1

    def _number(self, k: int) -> int | None:
        """Return a robot's number: digits or a small number word and no unit after it."""
        match = NUMBERED.match(self.text, self.words[k].start)
        point = any(p.start() == self.words[k].start for p in self.points)
        if match and not (point and self.plain[k - 1] in ("to", "at", "(", "point")):
            return int(match[1])
        after = self.plain[k + 1] if k + 1 < len(self.plain) else ""
        return None if after.startswith(("px", "pix", "deg", "met")) else SMALL.get(self.plain[k])

    def _number_end(self, k: int) -> int:
        match = NUMBERED.match(self.text, self.words[k].start)
        return match.end() if match else self.words[k].end

    def _amount(self, at: int) -> tuple[dict[str, Any], int] | None:
        """Read a number, a length, an angle or a share."""
        amount = next((q for q in self.amounts if q.start <= self.words[at].start < q.end), None)
        if amount is None or amount.start != self.words[at].start or amount.least != amount.most:
            return None
        end = self._until(at, amount.end)
        if amount.is_length:
            px = amount.px(self.standing.metres_per_pixel)
            return ({"m": amount.wording} if px is None else {"px": px[0]}), end
        if amount.kind == "degrees":
            return {"angle": amount.least}, end
        if amount.kind == "share":
            return {"share": amount.least}, end
        return {"num": amount.least}, end

    def _thing(self, at: int) -> tuple[dict[str, Any], int] | None:
        """Read a phrase for a thing, such as "the left tree" or "the big oak"."""
        start = at + (self.plain[at] in (*ARTICLES, "this", "that", "other"))
        if start == at and not self._may_open(at):
            return self._colour(at)
        if start >= len(self.words) or (start > at and self.plain[start] in ARTICLES):
            return None
        other = self.plain[at] == "other" or self.plain[start] == "other"
        start += self.plain[start] == "other" and start > at
        if start >= len(self.words):
            return None
        description = Description(self.plain, start)
        end = description.at
        led = at > 0 and self.plain[at - 1] in (*word_set("before_things"), *ARTICLES)
        strange = any(map(_has_other_meaning, self.plain[start:end]))
        if description.thing.noun and not description.thing.plural and not strange:
            heads = [w for w in self.plain[start:end] if w in word_set("formation_nouns")]
            if heads and not (at > 0 and self.plain[at - 1] in word_set("before_things")):
                return None
            if not _is_headed(self.plain[start:end]) or (
                end - start == 1 and self.plain[start] in ("one", "thing", "object")
            ):
                return None
            return {"thing": self._quote(start, end), "other": other} if other else {
                "thing": self._quote(start, end)
            }, end
        if start > at or led:
            return self._stranger(start, other)
        return None

    def _colour(self, at: int) -> tuple[dict[str, Any], int] | None:
        """Read a colour that stands for a known thing: "brown gets none"."""
        found = thing_phrase(self.plain, at)
        labels = {w for _, label in self.standing.things for w in label.lower().split()}
        colour = found is not None and found.kind == "colours" and self.plain[at] in labels
        return ({"thing": self.plain[at]}, at + 1) if colour else None

    def _may_open(self, at: int) -> bool:
        """Return whether a phrase for a thing may begin here without an article: "left tree"."""
        if at > 0 and self.plain[at - 1] in word_set("before_things"):
            return True
        found = thing_phrase(self.plain, at)
        after = thing_phrase(self.plain, at + 1) if at + 1 < len(self.plain) else None
        heads = [f is not None and f.kind in HEADS for f in (found, after)]
        return heads[0] or (
            heads[1] and self.plain[at] in (*SIDE_WORDS, *([self.plain[at]] if found else []))
        )

    def _stranger(self, start: int, other: bool) -> tuple[dict[str, Any], int] | None:
        """Read an unlisted noun after an article or preposition, with adjectives before it."""
        end = start
        while end < len(self.words) and end - start < 3:
            word = self.plain[end]
            adjective = (found := thing_phrase(self.plain, end)) is not None and found.kind not in (
                "skip",
                "relations",
                "partitive",
            )
            if not word[0].isalpha() or (word in known_words() and not adjective):
                return None
            end += 1
            if not adjective:
                quote = self._quote(start, end)
                return ({"thing": quote, "other": True} if other else {"thing": quote}), end
        return None

    def _quote(self, first: int, last: int) -> str:
        return self.text[self.words[first].start : self.words[last - 1].end]


def _is_headed(words: Sequence[str]) -> bool:
    """Return whether a noun for a thing is among the words."""
    return any(
        (found := thing_phrase(words, k)) is not None and found.kind in HEADS
        for k in range(len(words))
    )


def _has_other_meaning(word: str) -> bool:
    """Return whether a word says something other than which thing it is, or where."""
    if thing_phrase([word], 0) or word in table()["determiners"]:
        return word in PRONOUNS
    kinds = set(lexicon().get((word,), {"filler": ""}))
    placing = {"filler", "dir", "side", "towards", "about", "onword", "relation", "it", "there"}
    return not kinds & placing or word in PRONOUNS


@cache
def rules() -> dict[str, Any]:
    """Return the content of followups.yaml, every value as text."""
    text = resources.files(__package__ or "").joinpath("followups.yaml").read_text("utf-8")
    return yaml.load(text, yaml.BaseLoader)


def table_of(name: str) -> dict[str, int]:
    """Return a table of followups.yaml of whole numbers by word."""
    return {word: int(number) for word, number in rules()[name].items()}


@cache
def word_set(name: str) -> frozenset[str]:
    """Return a list of words of followups.yaml."""
    return frozenset(rules()[name])


@cache
def lexicon() -> dict[tuple[str, ...], dict[str, Any]]:
    """Return every phrase, without its articles, with its kinds and its value for each."""
    found: dict[tuple[str, ...], dict[str, Any]] = {}
    rows = [
        (kind, value, phrases)
        for kind, values in rules()["words"].items()
        for value, phrases in values.items()
    ]
    rows += [("filler", "", rules()["fillers"]), ("filler", "", sorted(fillers()))]
    rows += [("team", "", rules()["team"]), ("it", "", rules()["pronouns"])]
    rows += [
        (
            "lone",
            "",
            [w for w in rules()["robots"] if len(w) > 2 and not w.endswith("s") and w != "number"],
        )
    ]
    rows += [("robotword", "", [w for w in rules()["robots"] if w.endswith("s")])]
    rows += [("sep", "", rules()["separators"]), ("correction", "", rules()["corrections"])]
    for kind, value, phrases in rows:
        for phrase in phrases:
            words = tuple(m[0] for m in WORD.finditer(phrase))
            plain = tuple(w for w in words if w not in ARTICLES) or words
            found.setdefault(plain, {}).setdefault(kind, value)
    return found


@cache
def longest() -> int:
    """Return the number of words of the longest phrase, with room for articles."""
    return max(map(len, lexicon())) + 2


@cache
def known_words() -> frozenset[str]:
    """Return every word that is part of a phrase, or of a number."""
    return frozenset(w for words in lexicon() for w in words) | {*SMALL, *word_set("robots")}
