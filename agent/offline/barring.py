"""What an instruction forbids: that somebody gets in, or that robots do something.

A ring that something must not pass is closed; a denied demand on robots does not count.
"""

from collections.abc import Sequence
from itertools import pairwise

from .demands import Demand, Item, sentences
from .lexicon import NEGATIONS
from .reading import Reading

CLOSING = {"enclose", "enclosure", "prevent"}
MAY_BE = 0.2
"""Least probability of an arrangement at which one of its own words settles it."""
SUBJECTS = frozenset(("nobody", "none", "nothing", "no", "anything"))
"""Negations that are the subject of a sentence, whoever it is addressed to."""
ENDS = frozenset(",.;:!?()")
"""Punctuation that ends a clause, and a stretch of words that was not understood."""


class Barring:
    """The clauses of an instruction, and the items that say what must not happen."""

    def __init__(self, items: Sequence[Item], classes: Sequence[frozenset[str]]) -> None:
        self._items, self._classes = items, classes
        ends = [k for k, item in enumerate(items) if item.symbol in ENDS]
        bounds = pairwise([-1, *ends, len(items)])
        self.clauses = [range(first + 1, last) for first, last in bounds]
        self.prevented = self._prevented()

    def closes(self, reading: Reading, demands: Sequence[Demand]) -> bool:
        """Return whether a command for a ring has words that close it: a barrier all round."""
        if reading.relation != "around":
            return False
        closing = any(
            classes & CLOSING and not classes & {"surround", "ring", "near"}
            for k, classes in enumerate(self._classes)
            if self._items[k].label == "command" and not self._is_forbidden(k)
        )
        likely = dict(reading.meanings).get("cage", 0)
        escape = any(demand.sets == "closure" for demand in demands)
        return escape or self._prevents(demands) or (closing and likely >= MAY_BE)

    def _prevented(self) -> frozenset[int]:
        """Return the items that say what must not happen: "so that nobody gets near it"."""
        found: set[int] = set()
        for clause in self.clauses:
            start = next((k for k in clause if self._items[k].symbol == "so"), clause.stop)
            rest = range(start, clause.stop)
            symbols = {self._items[k].symbol for k in rest}
            prevents = any("prevent" in self._classes[k] for k in rest)
            if symbols & NEGATIONS and prevents and not symbols & {"robot", "robots"}:
                found |= {*rest}
        return frozenset(found)

    def _prevents(self, demands: Sequence[Demand]) -> bool:
        """Return whether a sentence says that something must not get in or out."""
        demanded = {k for d in demands for k in range(d.first, d.last)}
        at = 0
        for sentence in sentences(self._items):
            place = [k for k in range(at, at + len(sentence)) if k not in demanded]
            at += len(sentence)
            symbols = {self._items[k].symbol for k in place}
            negated = any(self._forbids_others(k, place) for k in place)
            if negated and any("prevent" in self._classes[k] for k in place):
                return True
            if "kept" in symbols and symbols & {"out", "away", "in"}:
                return True
        return False

    def _is_forbidden(self, k: int) -> bool:
        """Return whether robots are told not to do what item `k` says: "and do not block it"."""
        clause = next((c for c in self.clauses if k in c), range(0))
        before = [j for j in clause if j < k and self._items[j].symbol in NEGATIONS]
        return any(not self._forbids_others(j, clause) for j in before)

    def _forbids_others(self, k: int, sentence: Sequence[int]) -> bool:
        """Return whether a negation is of others: "nobody", but not "they must not touch it"."""
        symbol = self._items[k].symbol
        if symbol not in NEGATIONS or symbol == "without":
            return False
        clause = next(c for c in self.clauses if k in c)
        before = [j for j in sentence if j in clause and j < k]
        told = {self._items[j].symbol for j in before}
        orders = not told - {"and", "but", "so", "please", "they", "do"}
        robots = any("robot" in self._classes[j] for j in before)
        return symbol in SUBJECTS or not (orders or robots or told & {"they", "you"})
