"""Sorts the words that no rule took: a name, a reason, background that is quoted, or unread.

What is unread the planner quotes and asks about; nothing is dropped.
"""

from collections.abc import Iterator, Sequence

from .barring import ENDS, Barring
from .demands import Item, says_inside, says_more
from .drawn_forms import CORNERED
from .lexicon import NEGATIONS, WEIGHTY, fillers, goes_with, weighs
from .reading import Reading

SURE_BACKGROUND, SURE_ALONE, SURE_NUMBER = 0.5, 0.8, 0.8
"""Least probabilities of background: of a word next to some, of a word alone, and of a number."""
REASONS = frozenset(("so", "because", "since", "before", "until", "while", "lest", "for", "as"))
"""Words with which a reason or purpose begins."""
LINES = frozenset(("file", "line", "row", "column", "arc", "circle", "ring", "grid", *CORNERED))
"""Forms robots may stand in; words that say "a" and one of these are never background."""
SEVERAL_LINES = frozenset(f"{line}s" for line in LINES)
SPEAKERS = frozenset(("i", "we", "you", "one", "people", "visitors", "everyone", "everybody"))
"""After "so" one of these begins a purpose, which demands nothing more."""
ASKED_CLASSES = frozenset(("gap", "avoid", "far", "near", "side", "face", "each", "motion"))
"""Classes of words that may make a reason a demand."""
PLACES = {
    "around": ("around", "round", "about"),
    "inside": ("inside", "in", "on", "within", "over", "across", "onto", "into"),
    "along": ("beside", "by", "near", "at", "to"),
}
"""Words directly before a thing, by the place they give to a drawn form."""
PREPOSITIONS = frozenset(word for words in PLACES.values() for word in words)
BEFORE_NOUNS = frozenset(("of", "around", "round", "inside", "within", "along", "beside", "across"))
"""Words after which a noun without an article names the thing: "8 inside bunker"."""
LEADING_NOUNS = frozenset(("above", "below", "beneath", "under", "over", "of", "behind"))
LONGEST_NAME = 3
DEFINITE = frozenset(("the", "this", "that", "these", "those", "my", "our", "your"))
"""Determiners that begin a phrase for a thing after a preposition."""


def demands_more(phrase: str, relation: str) -> bool:
    """Return whether a phrase for a thing says more than which, or where else robots stand."""
    return says_more(phrase) or (relation not in ("inside", "centre") and says_inside(phrase))


class Leftovers:
    """The items of an instruction that rules left, and what they are."""

    def __init__(
        self,
        text: str,
        items: Sequence[Item],
        reading: Reading,
        classes: Sequence[frozenset[str]],
        taken: Sequence[bool],
        barring: Barring,
    ) -> None:
        self.text, self.items, self.reading = text, items, reading
        self.classes, self.taken = classes, taken
        self.clauses, self.prevented = barring.clauses, barring.prevented
        self.scenery = [False] * len(items)

    def account(self) -> None:
        """Sort the words that nothing took into background and unread."""
        kinds = [self._kind(k) for k in range(len(self.items))]
        for first, last in self._runs():
            within = kinds[first:last]
            if "unread" in within:
                self._account_unread(first, last)
                continue
            aside = [k for k in range(first, last) if kinds[k] == "background"]
            said = {self.items[k].symbol for k in aside if "robot" not in self.classes[k]}
            if said - fillers() - REASONS:
                reading = self.reading
                drawn = (said & LINES and "a" in said) or said & SEVERAL_LINES
                sort = reading.unread if drawn else reading.background
                sort.append(self._quote(aside[0], aside[-1] + 1))

    def _account_unread(self, first: int, last: int) -> None:
        """Sort unread words: a reason is background, what follows "around the" may be the thing."""
        reading = self.reading
        at = next((k for k in range(first, last) if self.items[k].symbol in BEFORE_NOUNS), first)
        if "unread" not in map(self._kind, range(first, at)):
            first = at  # "ring" is known in "ring around fountain"
        words = [i.symbol for i in self.items[first:last]]
        named = words[0] in PREPOSITIONS and len(words) > 2 and words[1] in DEFINITE
        named = named or (words[0] in BEFORE_NOUNS and self._is_bare(first + 1, last))
        if self._ends_in_noun(first, last):
            reading.things.append(self._quote(first, last))
            return
        known = {w for thing in reading.things for w in thing.lower().split()}
        if words[0] in ("from", "at", "to", "of") and {*words[1:]} and {*words[1:]} <= known:
            return
        if words[0] == "between" and words[-1] == "and" and self._is_bare(first + 1, last - 1):
            reading.things.insert(0, self._quote(first + 1, last - 1))
        elif self._gives_reason(first, last):
            reading.background.append(self._quote(first, last))
        elif named and not reading.things and self._only_names(first + 1, last):
            reading.things.append(self._quote(first + 1, last))
        else:
            reading.unread.append(self._quote(first, last))

    def _ends_in_noun(self, first: int, last: int) -> bool:
        """Return whether words are the noun of a side that a rule took: "above conveyor"."""
        led = first > 0 and self.taken[first - 1] and self.items[first - 1].symbol in LEADING_NOUNS
        return led and not self.reading.things and self._is_bare(first, last)

    def _is_bare(self, first: int, last: int) -> bool:
        """Return whether words are a noun, perhaps with adjectives, without an article."""
        words = [i.symbol for i in self.items[first:last]]
        plain = all(w.isalpha() and w not in WEIGHTY | fillers() for w in words)
        telling = any(self.classes[k] & ASKED_CLASSES - {"motion"} for k in range(first, last))
        return plain and not telling and 0 < len(words) <= LONGEST_NAME

    def _only_names(self, first: int, last: int) -> bool:
        """Return whether words can be a phrase for a thing that says nothing else."""
        says = any(i.quantity or i.symbol in NEGATIONS for i in self.items[first:last])
        return not says and not demands_more(self._quote(first, last), self.reading.relation)

    def _gives_reason(self, first: int, last: int) -> bool:
        """Return whether a stretch of words is a reason or purpose that demands nothing more."""
        words = self.items[first:last]
        if any(i.quantity for i in words):
            return False
        caged = self.reading.relation == "cage"
        weighty = [i for i in words if i.symbol in WEIGHTY]
        if caged and any(i.symbol in NEGATIONS for i in words):
            return all(i.symbol in NEGATIONS for i in weighty)
        opening = [i.symbol for i in words[:3] if i.symbol != "that"]
        if opening[0] == "so" and opening[1:2] and opening[1] in SPEAKERS:
            return True
        if words[0].symbol not in REASONS or weighty:
            return False
        if {"opening", "sides"} & set(self.reading.group):
            return True
        return not any(self.classes[k] & ASKED_CLASSES for k in range(first, last))

    def _runs(self) -> Iterator[tuple[int, int]]:
        """Yield runs of words that no rule took, as first and past-the-last index."""
        open_ = [not self.taken[k] and item.symbol not in ENDS for k, item in enumerate(self.items)]
        start = 0
        while start < len(open_):
            end = start
            while end < len(open_) and open_[end]:
                end += 1
            if end > start:
                yield start, end
            start = max(end, start + 1)

    def _kind(self, k: int) -> str:
        """Return "" for an item that is accounted for, else "filler", "background" or "unread"."""
        item = self.items[k]
        if self.taken[k] or not (
            item.symbol[0].isalnum() or item.symbol in ("<t>", "<n>", "<l>", "<a>", "<s>", "<c>")
        ):
            return ""
        caged = self.reading.relation == "cage" and item.quantity is None
        if self.scenery[k] or (caged and k in self.prevented):
            return "background"
        if item.quantity is not None:
            if self._counts_corners(item):
                return ""
            return "background" if self.is_background_number(k) else "unread"
        beside = {self.items[n].label for n in (k - 1, k + 1) if n in range(len(self.items))}
        sure = SURE_BACKGROUND if "background" in beside else SURE_ALONE
        if item.label == "background" and item.certainty >= sure:
            return "background"
        if weighs(item.symbol, self.classes[k], self.reading.relation):
            return "unread"
        if item.symbol in fillers():
            return "filler"
        if "polite" in self.classes[k] and "place" not in self.classes[k]:
            return "background"
        known = goes_with(item.symbol, self.classes[k], self.reading.relation)
        return "" if known else "unread"

    def is_background_number(self, k: int) -> bool:
        """Return whether a number stands in a clause that is surely background: "come at three"."""
        clause = next(c for c in self.clauses if k in c)
        words = [self.items[j] for j in clause]
        told = all(i.label in ("background", "thing") for i in words if i.symbol not in ENDS)
        return self.items[k].symbol == "<n>" and told and self.items[k].certainty >= SURE_NUMBER

    def _counts_corners(self, item: Item) -> bool:
        """Return whether a number counts the corners, or the one robot at each."""
        number = item.quantity and item.quantity.whole
        return self.reading.relation == "corners" and number in (1, 4, self.reading.robots)

    def _quote(self, first: int, last: int) -> str:
        return " ".join(self.text[self.items[first].start : self.items[last - 1].end].split())
