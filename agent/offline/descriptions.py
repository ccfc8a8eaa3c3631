"""Parser of one description into what is measured: "the small red one left of the pond"."""

from dataclasses import dataclass, field
from typing import Any

from .idioms import comparison, difference, position
from .phrases import HEADS, STOPS, Phrase, Words, phrase, table

STRANGERS = 3
"""How far a known noun may be behind an unknown word, in words."""


@dataclass
class Reference:
    """One thing that words describe.

    Attributes:
        wording: the words.
        query: fields of a Query that say how it looks and where it is.
        noun: the kind of thing, a key of the noun table, or "shape"; "" where it is not known.
        called: the noun in the person's words; "" where there is none.
        weak: whether the noun says little that can be measured.
        plural: whether several things are meant.
        unknown: words about it that are not understood.
        refused: words that change which thing is meant in an unsupported way, or "".
    """

    wording: str = ""
    query: dict[str, Any] = field(default_factory=dict[str, Any])
    noun: str = ""
    called: str = ""
    weak: bool = False
    plural: bool = False
    unknown: list[str] = field(default_factory=list[str])
    refused: str = ""

    @property
    def strange(self) -> bool:
        """Whether nothing about the thing is understood."""
        return not self.noun and not self.query

    @property
    def named_query(self) -> dict[str, Any] | None:
        """The query with its noun, for detectors; None without one or if more is not understood."""
        only = {"", self.called}
        if not self.called or self.refused not in only or not only.issuperset(self.unknown):
            return None
        return {"noun": self.called, **self.query}

    @property
    def whole_query(self) -> dict[str, Any]:
        """The query for all that is measured: for the noun (a coin is round) and for the words."""
        merged = dict(table()["nouns"].get(self.noun, {}).get("query", {}))
        for name, value in self.query.items():
            joined = name in ("traits", "picks", "relations") and name in merged
            merged[name] = list(dict.fromkeys([*merged[name], *value])) if joined else value
        return merged


class Description:
    """Reads a description that begins at a given word.

    Attributes:
        thing: what was understood.
        at: index of the word after the description.
        closed: whether a part of the thing follows, as in "the boat's left side".
    """

    def __init__(self, words: Words, at: int, nested: bool = False) -> None:
        self.words, self.at, self._nested = words, at, nested
        self.thing = Reference()
        self._place = 0
        self._headed = self.closed = self._partitive = False
        while self.at < len(words) and not self.closed and self._step():
            pass
        if self._place:
            self.thing.refused = "an ordinal without an order"

    def _step(self) -> bool:
        word = self.words[self.at]
        if word in (",", "and"):
            return self._joined()
        if word in STOPS:
            return False
        return (
            self._count()
            or self._relation()
            or self._compared()
            or self._hint()
            or self._known()
            or self._relative()
            or self._apposed()
            or self._blocked()
            or self._unknown()
        )

    def _joined(self) -> bool:
        """Take a comma or "and" between adjectives."""
        following = phrase(self.words, self.at + 1)
        adjective = following is not None and following.kind not in ("skip", "relations", "noun")
        if self._headed or not adjective:
            return False
        self.at += 1
        return True

    def _count(self) -> bool:
        """Take a number of things: the two red ones, the left one of the three."""
        count = table()["counts"].get(self.words[self.at])
        if count is None or (self._headed and not self._partitive):
            return False
        self.thing.query["count"] = int(count)
        self.at += 1
        return True

    def _relation(self) -> bool:
        """Take a relation to other things: left of the pond, between the plate and the coin."""
        found = phrase(self.words, self.at)
        if found is None or found.kind != "relations":
            return False
        others: list[Reference] = []
        end = self.at + found.length
        if self._nested and self.words[end : end + 1] == [
            "the"
        ]:  # in a chain it is unclear which thing a relation is of
            self.thing.refused = " ".join(self.words[self.at : end])
            return False
        for _ in range(2 if found.value == "between" else 1):
            if others and self.words[end : end + 1] == ["and"]:
                end += 1
            if end >= len(self.words) or self.words[end] not in table()["determiners"]:
                return False
            other = Description(self.words, end + 1, nested=True)
            others.append(other.thing)
            end = other.at
        if any(_unclear(other) for other in others):
            return False
        relation = {"kind": found.value, "things": [other.whole_query for other in others]}
        self.thing.query.setdefault("relations", []).append(relation)
        self.at = end
        return True

    def _compared(self) -> bool:
        """Take "than any of the others", which only repeats a superlative."""
        length = comparison(self.words, self.at)
        self.at += length
        return length > 0

    def _hint(self) -> bool:
        """Take an idiom: unlike the others in colour; in the upper left corner of the picture."""
        found = max(
            filter(None, (difference(self.words, self.at), position(self.words, self.at))),
            key=lambda hint: hint[1],
            default=None,
        )
        known = phrase(self.words, self.at)
        if found is None or (known is not None and known.length > found[1]):
            return False
        self._pick(found[0])
        self.at += found[1]
        return True

    def _known(self) -> bool:
        found = phrase(self.words, self.at)
        if found is None or found.kind == "relations":
            return False
        if found.kind in HEADS and not self._head(found):
            return False
        if found.kind == "picks":
            self._pick(found.value)
        elif found.kind == "ordinal":
            self._place = int(found.value)
        elif found.kind == "partitive":
            self._partitive = True
        elif found.kind in ("shades", "traits", "colours", "shapes"):
            self._adjective(found)
        self.at += found.length
        self.closed = found.owns
        return True

    def _relative(self) -> bool:
        """Take "that" or "which", but only if something known follows."""
        words, at = self.words, self.at + 1
        if words[self.at] not in table()["relative"]:
            return False
        if not (phrase(words, at) or difference(words, at) or position(words, at)):
            return False
        self.at = at
        return True

    def _apposed(self) -> bool:
        """Take the article in "which is the largest"."""
        words, at = self.words, self.at
        following = phrase(words, at + 1)
        ranked = following is not None and following.kind in ("picks", "ordinal")
        if words[at] != "the" or words[at - 1] != "is" or not ranked:
            return False
        self.at += 1
        return True

    def _blocked(self) -> bool:
        if self.words[self.at] not in table()["blockers"]:
            return False
        self.thing.refused = self.words[self.at]
        self.at += 1
        return True

    def _head(self, found: Phrase) -> bool:
        """Take a noun, unless there is one already: then it belongs to another thing."""
        thing = self.thing
        open_still = thing.noun == "shape" or (self._partitive and thing.noun in ("", "any"))
        if self._headed and not open_still:
            return found.value == "any"  # the red one of the crates; the crate object
        if found.kind == "noun" and not (found.value == "any" and thing.noun == "shape"):
            thing.noun = found.value
            said = self.words[self.at : self.at + found.length]
            thing.called = "" if found.value == "any" else " ".join(said)
            thing.weak = "weak" in table()["nouns"][found.value]
        elif found.kind == "shapes" and thing.noun in ("", "any"):
            thing.noun = "shape"
        self._headed = True
        thing.plural = found.plural and not self._partitive
        return True

    def _adjective(self, found: Phrase) -> None:
        query = self.thing.query
        if found.kind == "shades":
            query["shade"] = found.value
        elif found.kind == "colours" and query.get("colours", [found.value]) != [found.value]:
            self.thing.refused = "two colours"
        else:
            values = query.setdefault(found.kind, [])
            if found.value not in values:
                values.append(found.value)

    def _pick(self, by: str) -> None:
        pick: dict[str, Any] = {"by": by}
        if self._place > 1:
            pick["place"] = self._place
        self._place = 0
        picks = self.thing.query.setdefault("picks", [])
        if pick not in picks:
            picks.append(pick)

    def _unknown(self) -> bool:
        """Take an unknown word if a known noun follows closely."""
        words = self.words
        if self._headed or words[self.at] in table()["follow"]:
            return False
        if words[self.at + 1 : self.at + 2] == ["of"]:  # the shiniest of the coins
            self.thing.refused = words[self.at]
        for ahead in range(1, STRANGERS + 1):
            if self.at + ahead >= len(words) or words[self.at + ahead] in STOPS:
                return False
            found = phrase(words, self.at + ahead)
            if found is not None and found.kind in HEADS:
                self.thing.unknown.append(words[self.at])
                self.at += 1
                return True
        return False


def _unclear(thing: Reference) -> bool:
    """Return whether another thing, named to say where one is, is not understood itself."""
    nothing = not thing.whole_query or not thing.noun
    return bool(thing.refused or thing.plural or nothing or "relations" in thing.query)
