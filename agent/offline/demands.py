"""Demands of an instruction beside number, thing and arrangement, by the rules of demands.yaml.

The words become one line of symbols, in which a phrase for a thing or a quantity is a single
symbol; a rule takes the symbols that its pattern matches, and no other rule may take them.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import yaml

from ...tools.formation.quantities import Quantity, quantities_in
from .relabelled import relabelled
from .tagging import Tagging, Token

SYMBOLS = {"px": "<l>", "m": "<l>", "degrees": "<a>", "share": "<s>", "compound": "<c>"}
ALWAYS = ("a negation", "a cancellation", "something past", "another task", "a span of time")
"""Kinds of stops that also count in words that look like background beside an order."""
POINTING = ("no", "the", "each", "every", "any", "this", "that", "single", "next")
"""Words before a "one" that stands for a noun."""
PURPOSES = ("closure", "count")
"""What is also demanded by what sounds like background: "so that it cannot get out"."""
OF_ROBOTS = re.compile(
    r"\b(?:so|such|way) (?:that )?(?:they|all|each|every|every(?:one|body)|(?:the )?robots)\b"
    r"[^.;!?]*$"
)
"""Before a demand: a purpose that says how robots are to stand is no background."""
SURE_SCENIC = 0.8
"""Least probability of each word of a sentence that only sets the scene."""
TOLD_OF = ("nobody", "no", "none", "there", "we", "i", "they", "it", "it's", "there's")
"""First words of a sentence in which a time is not meant for the robots."""
OPENING_CONDITIONS = ("unless", "until", "if", "once", "as", "provided")
"""First words that make the instruction conditional."""
WRAPPED = re.compile(r"\s*\|\s*")
SENTENCE_ENDS = (".", "!", "?", ";")


@dataclass(frozen=True)
class Item:
    """One symbol of the line: a word, a sign, a quantity or a whole phrase for a thing.

    Attributes:
        symbol: the word, lower case, or <t>, <n>, <l>, <a>, <s>, <c>.
        start, end: its position in the instruction, in characters.
        label, certainty: its role, one of tagging.LABELS, and the probability of that.
        quantity: the number or length; None for other symbols.
    """

    symbol: str
    start: int
    end: int
    label: str
    certainty: float
    quantity: Quantity | None = None


@dataclass(frozen=True)
class Demand:
    """A demand that a rule found.

    Attributes:
        sets: what it is about, as named in demands.yaml.
        value: the value that the rule gives, such as "towards"; "" where the words give it.
        sides: left, right, top, bottom, up, down, in the order of the words.
        quantity: the number or length that was named, if one was.
        numbers: all quantities in it.
        bound: whether the quantity is the "least" or the "most"; "" for neither.
        first, last: its items, first and past-the-last index.
        other: the same of a phrase in it for another thing, where the rule marks one.
    """

    sets: str
    value: str
    sides: tuple[str, ...]
    quantity: Quantity | None
    numbers: tuple[Quantity, ...]
    bound: str
    first: int
    last: int
    other: tuple[int, int] | None = None


def items_of(text: str, words: Sequence[Token], tagging: Tagging) -> tuple[Item, ...]:
    """Return the symbols of an instruction; adjacent words for things become one."""
    corrected = relabelled(words, tagging.labels)
    labels = dict(zip((w.start for w in words), corrected, strict=True))
    plain = [q for q in quantities_in(text) if _is_plain(q, words, labels)]
    found: list[Item] = []
    for word, label, certainty in zip(words, corrected, tagging.certainty, strict=True):
        last = found[-1] if found else None
        covering = next((q for q in plain if q.start <= word.start < q.end), None)
        if covering is not None:
            if last is None or last.quantity is not covering:
                symbol = SYMBOLS.get(covering.kind, "<n>")
                found.append(Item(symbol, covering.start, covering.end, label, certainty, covering))
        elif label == "thing" and last is not None and last.symbol == "<t>":
            found[-1] = Item("<t>", last.start, word.end, label, min(last.certainty, certainty))
        else:
            symbol = "<t>" if label == "thing" else word.text
            found.append(Item(symbol, word.start, word.end, label, certainty))
    return tuple(found)


def _is_plain(quantity: Quantity, words: Sequence[Token], labels: dict[int, str]) -> bool:
    """Return whether it is not part of a phrase for a thing, nor a "one" in place of a noun."""
    inside = [labels[w.start] for w in words if quantity.start <= w.start < quantity.end]
    after = next((w.text for w in words if w.start >= quantity.end), "")
    following = [w.text for w in words if w.start >= quantity.end][: 3 if after.isalpha() else 0]
    led = [labels[w.start] for w in words if w.end <= quantity.start][-1:]
    if quantity.wording.lower() == "one" and "thing" in inside and led == ["thing"]:
        return False  # "the red one with six robots"
    if "thing" in inside and not any(_robots().fullmatch(word) for word in following):
        return False
    if quantity.wording.lower() != "one":
        return True
    before = next((w.text for w in reversed(words) if w.end <= quantity.start), "")
    return before not in POINTING and (
        after not in ("after", "by", "another", "behind", "beside", "next", "to", *_table()["rows"])
    )


def demands_in(items: Sequence[Item]) -> tuple[Demand, ...]:
    """Return the demands that rules find, in their order; an item is in one demand at most."""
    line = _Line(items)
    free = [True] * len(items)
    found: list[Demand] = []
    for rule in _rules():
        for pattern in rule.patterns:
            for match in pattern.finditer(line.text):
                first, last = line.items_of(match)
                told = all(i.label == "background" and not i.quantity for i in items[first:last])
                if rule.sets in PURPOSES or OF_ROBOTS.search(line.text[: match.start()]):
                    told = False
                if last > first and all(free[first:last]) and not told:
                    free[first:last] = [False] * (last - first)
                    found.append(_demand(rule, match, items, first, last, line))
    return tuple(found)


def stops_in(items: Sequence[Item]) -> tuple[tuple[str, int, int], ...]:
    """Return why an instruction is no order to place robots now: kinds, and positions of the words.

    Background does not count, except for the kinds in ALWAYS, such as a negation.
    """
    found: list[tuple[str, int, int]] = []
    parts = sentences(items)
    for sentence in parts:
        line = _Line(sentence)
        asked_only = all(s[-1].symbol == "?" for s in parts)
        words = [i for i in sentence if i.symbol.isalpha()]
        aside = ("background", "thing")
        scenic = all(i.label in aside and i.certainty >= SURE_SCENIC for i in words)
        for kind, pattern in _stops():
            for match in pattern.finditer(line.text):
                first, last = line.items_of(match)
                meant = any(i.label != "background" for i in sentence[first:last])
                opens = first == 0 and sentence[0].symbol in OPENING_CONDITIONS
                told = scenic and last - first < len(words)
                told |= kind == "a time" and len(parts) > 1 and sentence[0].symbol in TOLD_OF
                meant &= not (told and kind == "a time")
                stops = meant or opens or (kind in ALWAYS and not told)
                stops = stops and (kind != "a question" or asked_only)
                orders = len(parts) == 1 or any(i.quantity for i in sentence)
                if stops and (kind != "something past" or orders):
                    found.append((kind, sentence[first].start, sentence[last - 1].end))
    return tuple(found)


def word_list(name: str) -> frozenset[str]:
    """Return a list of words of demands.yaml."""
    return frozenset(map(str, _table()[name]))


def says_more(phrase: str) -> bool:
    """Return whether a phrase for a thing says more than which thing, such as "every coin"."""
    return any(pattern.search(phrase.lower()) for pattern in _patterns("in_things"))


def says_others(phrase: str) -> bool:
    """Return whether a phrase says that the thing is not meant: "the grey ones don't matter"."""
    return any(pattern.search(phrase.lower()) for pattern in _patterns("others"))


def says_inside(phrase: str) -> bool:
    """Return whether a phrase for a thing is about its inside: "the inside of the box"."""
    return any(pattern.search(phrase.lower()) for pattern in _patterns("insides"))


def is_part(phrase: str) -> bool:
    """Return whether a phrase names a part from which distances are given: "the wings"."""
    parts = re.sub(WRAPPED, "|", _table()["words"]["SURFACE"])
    return re.fullmatch(f"(?:(?:the|its|their) )?(?:{parts})", phrase.lower()) is not None


@cache
def _patterns(name: str) -> tuple[re.Pattern[str], ...]:
    return tuple(re.compile(pattern) for pattern in _table()[name])


def sentences(items: Sequence[Item]) -> list[list[Item]]:
    """Return the items, sentence by sentence."""
    found: list[list[Item]] = [[]]
    for item in items:
        found[-1].append(item)
        if item.symbol in SENTENCE_ENDS:
            found.append([])
    return [s for s in found if s]


class _Line:
    """The symbols as one text, to find which of them a match covers."""

    def __init__(self, items: Sequence[Item]) -> None:
        self.text = " ".join(i.symbol for i in items)
        self._starts: list[int] = []
        at = 0
        for item in items:
            self._starts.append(at)
            at += len(item.symbol) + 1

    def items_of(self, match: re.Match[str], group: str | int = 0) -> tuple[int, int]:
        """Return the first and past-the-last index of the items in a group of a match."""
        start, end = match.span(group)
        covered = [k for k, at in enumerate(self._starts) if start <= at < end]
        return (covered[0], covered[-1] + 1) if covered else (0, 0)


@dataclass(frozen=True)
class _Rule:
    sets: str
    value: str
    patterns: tuple[re.Pattern[str], ...]

    @property
    def measures(self) -> bool:
        """Whether the rule's patterns say which number is the length."""
        return any("{LENGTH}" in p.pattern or "(?P<l" in p.pattern for p in self.patterns)


def _demand(
    rule: _Rule, match: re.Match[str], items: Sequence[Item], first: int, last: int, line: _Line
) -> Demand:
    named = {
        name: value for name, value in match.groupdict().items() if value is not None and value
    }
    lengths = [name for name in named if name.rstrip("0123456789") == "l"]
    quantity = items[line.items_of(match, lengths[0])[0]].quantity if lengths else None
    sides = tuple(
        _side(value) for name, value in named.items() if name.rstrip("0123456789") == "side"
    )
    numbers = tuple(i.quantity for i in items[first:last] if i.quantity is not None)
    bound = next((b for b in ("least", "most") if any(n.startswith(b) for n in named)), "")
    return Demand(
        rule.sets,
        rule.value,
        sides,
        quantity or (None if rule.measures else next(iter(numbers), None)),
        numbers,
        bound,
        first,
        last,
        next((line.items_of(match, n) for n in named if n.rstrip("0123456789") == "other"), None),
    )


def _side(word: str) -> str:
    return next((side for side, names in _table()["sides"].items() if word in names), word)


@cache
def _table() -> dict[str, Any]:
    text = resources.files(__package__ or "").joinpath("demands.yaml").read_text("utf-8")
    return yaml.safe_load(text)


@cache
def _robots() -> re.Pattern[str]:
    return re.compile(re.sub(WRAPPED, "|", _table()["words"]["ROBOT"]))


@cache
def _rules() -> tuple[_Rule, ...]:
    return tuple(
        _Rule(row["sets"], str(row.get("value", "")), tuple(_compiled(p) for p in row["patterns"]))
        for row in _table()["rules"]
    )


@cache
def _stops() -> tuple[tuple[str, re.Pattern[str]], ...]:
    return tuple(
        (kind, _compiled(pattern))
        for kind, patterns in _table()["stops"].items()
        for pattern in patterns
    )


def _compiled(pattern: str) -> re.Pattern[str]:
    """Compile a pattern with its lists expanded, matching whole symbols, its groups numbered."""
    words = _table()["words"]
    while (name := re.search(r"\{([A-Z_]+)\}", pattern)) is not None:
        pattern = pattern.replace(name[0], f"(?:{re.sub(WRAPPED, '|', words[name[1]])})")
    number = iter(range(10_000))
    pattern = re.sub(r"\(\?P<(\w+)>", lambda m: f"(?P<{m[1]}{next(number)}>", pattern)
    return re.compile(rf"(?<!\S)(?:{pattern})(?!\S)")
