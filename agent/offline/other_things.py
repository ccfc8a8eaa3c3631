"""Demands that name a thing other than the arrangement's: to look at, to keep off, to face."""

import re
from collections.abc import Sequence

from .demands import Demand, Item
from .lexicon import fillers
from .portions import Portions
from .reading import Reading
from .tagging import tokens

PRONOUNS = ("it", "this", "that", "them", "him", "her")
OWN = frozenset(("the", "that", "my", "our"))
"""Words before a noun that names a thing."""
FAR_OFF = frozenset(("well", "far", "long", "plenty", "safe", "good"))
"""Words of "stay well away from it" that say how far."""
SEVERAL = re.compile(r"\b(?:two|three|four|five|six|both|pair|[a-z]+[^s\W]s)\b")
"""Words that a phrase for more than one thing contains."""


class OtherThings(Portions):
    """Rules that carry demands about further things over into a reading."""

    def __init__(
        self, text: str, items: Sequence[Item], reading: Reading, metres_per_pixel: float | None
    ) -> None:
        super().__init__(items, reading, metres_per_pixel)
        self.text = text
        self.pointing: list[Demand] = []  # headings that may be of a form's tip, not of the robots
        self.mentioned: list[int] = []  # items of demands whose phrases may name the target

    def _heading(self, demand: Demand) -> bool:
        other = self._other(demand)
        if self._points(demand):
            self.pointing.append(demand)
        if other is None or not self._refers_elsewhere(demand):
            return self._set("heading", demand.value)
        return demand.value == "towards" and self._aim("heading", other)

    def _points(self, demand: Demand) -> bool:
        said = {self.items[k].symbol for k in range(demand.first, demand.last)}
        return not said.isdisjoint(("pointing", "points", "point", "pointed", "aimed", "aiming"))

    def _heading_at(self, demand: Demand) -> bool:
        """Read a look at a thing whose noun the tagger did not take for one."""
        phrase = self._noun_in(demand)
        if phrase is None or self._refers_elsewhere(demand):
            return phrase is not None and self._aim("heading", phrase)
        self.reading.things.append(phrase)
        return self._set("heading", "towards")

    def _refers_elsewhere(self, demand: Demand) -> bool:
        """Return whether other words than a demand's name or point at a thing."""
        within = range(demand.first, demand.last)
        named = {item.symbol for k, item in enumerate(self.items) if k not in within}
        return not named.isdisjoint(("<t>", *PRONOUNS))

    def _noun_in(self, demand: Demand) -> str | None:
        """Return a demand's words from the last "the" to its end, or to a "side" after them."""
        words = [self.items[k].symbol for k in range(demand.first, demand.last)]
        at = [k for k, word in enumerate(words) if word in OWN]
        if not at:
            return None
        until = words.index("side") if "side" in words[at[-1] :] else len(words)
        return self._quote(demand.first + at[-1], demand.first + until)

    def _aim(self, field: str, phrase: str) -> bool:
        """Have robots look at another thing, or an opening be towards it."""
        return self.reading.aims.setdefault(field, phrase) == phrase

    def _keep_out(self, demand: Demand) -> bool:
        other = self._other(demand) or self._marked(demand)
        if other is None:  # of the thing itself, which they stand off anyway
            far = FAR_OFF & {i.symbol for i in self.items[demand.first : demand.last]}
            stands = self.reading.relation in ("around", "cage", "along", "corners")
            return stands and (not far or self._set("fit", "wide"))
        self.reading.others.append(other)
        return True

    def _marked(self, demand: Demand) -> str | None:
        """Return the noun that a rule marks as another thing and the tagger as none."""
        first, last = demand.other or (0, 0)
        return self._quote(first, last) if last - first > 1 else None

    def _faced(self, demand: Demand) -> bool:
        named = [k for k in range(demand.first, demand.last) if self.items[k].symbol == "<t>"]
        if self.reading.relation != "along" or self.reading.faced:
            return False
        noun = None if demand.other else self._noun_in(demand)
        if noun is not None:  # "on the water side of the towel"
            self.reading.faced = noun
            self.mentioned += named
            return True
        if not named:
            return False
        self.reading.faced = self._quote(named[-1], named[-1] + 1)
        self.mentioned += named[:-1]
        return True

    def _other(self, demand: Demand) -> str | None:
        """Return a demand's phrase for a thing that the arrangement is not about; None if none."""
        within = range(demand.first, demand.last)
        phrases = {k: self._words_of(k) for k, i in enumerate(self.items) if i.symbol == "<t>"}
        mine = [words for k, words in phrases.items() if k not in within]
        for k in within:
            if k in phrases and not any(phrases[k] <= words for words in mine):
                return self.text[self.items[k].start : self.items[k].end]
        return None

    def _words_of(self, k: int) -> set[str]:
        item = self.items[k]
        words = {w.text for w in tokens(self.text[item.start : item.end]) if w.text.isalpha()}
        return words - fillers()

    def _left_alone(self, demand: Demand) -> bool:
        """Note other things as background: robots keep off them anyway."""
        self.reading.background.append(self._quote(demand.first, demand.last))
        return True

    def _which_of(self, demand: Demand) -> bool:
        """Accept which of several things is meant, "the upper of the drums"; not a part of one."""
        after = self.items[demand.last]
        return SEVERAL.search(self.text[after.start : after.end].lower()) is not None

    def _quote(self, first: int, last: int) -> str:
        return " ".join(self.text[self.items[first].start : self.items[last - 1].end].split())
