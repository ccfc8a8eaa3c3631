"""Reader that turns an instruction into fields of a contract and accounts for every word.

Each word is taken by one rule, refers to a thing, is a known word of the command, is background
that is quoted back to the person, or is left unread: then the planner quotes it and asks.
"""

from collections.abc import Iterator, Sequence

from .barring import ENDS, MAY_BE, Barring
from .demand_fields import LENGTHS, Fields
from .demands import (
    PURPOSES,
    Item,
    demands_in,
    items_of,
    says_inside,
    says_more,
    says_others,
    sentences,
    stops_in,
)
from .drawn_forms import CORNERED, form_in
from .evidence import meaning_of, weighed
from .languages import foreign_language
from .lexicon import CLASSES_OF, NEGATIONS, WEIGHTY, fillers, goes_with, may_command, weighs
from .reading import Reading
from .spans import may_open
from .tagging import tag, tokens, word_classes

SURE_BACKGROUND, SURE_ALONE, SURE_NUMBER = 0.5, 0.8, 0.8
"""Least probabilities of background: of a word next to some, of a word alone, and of a number."""
SCENIC, WEIGHTY_SCENIC = 0.4, 0.5
"""Least share of non-command words that makes a sentence background; second: a weighty one."""
REASONS = frozenset(("so", "because", "since", "before", "until", "while", "lest", "for", "as"))
"""Words with which a reason or purpose begins."""
OF_OTHERS = frozenset(("keep_out", "faced", "left_alone", "rings_of"))
"""Demands that name a thing other than the one the arrangement is about."""
LONGEST_CALL = 3
"""Most words of an exclamation that only addresses somebody: "Ball boys!"."""
LINES = frozenset(("file", "line", "row", "column", "arc", "circle", "ring", "grid", *CORNERED))
"""Forms robots may stand in; words that say "a" and one of these are never background."""
RINGS = frozenset(("ring", "radius", "diameter"))
"""Demands that only a ring can meet."""
SPEAKERS = frozenset(("i", "we", "you", "one", "people", "visitors", "everyone", "everybody"))
"""After "so" one of these begins a purpose, which demands nothing more."""
STATING = frozenset(
    ("is", "are", "was", "were", "has", "have", "had", "could", "might", "will", "it's", "there's")
)
"""Words that mark a sentence as a statement."""
VAGUE = {"nobody", "area"}
"""Classes of everyday words: a sentence with no others does not name an arrangement."""
ASKED_CLASSES = frozenset(("gap", "avoid", "far", "near", "side", "face", "each", "motion"))
"""Classes of words that may make a reason a demand."""
PLACES = {
    "around": ("around", "round", "about"),
    "inside": ("inside", "in", "on", "within", "over", "across", "onto", "into"),
    "along": ("beside", "by", "near", "at", "to"),
}
"""Words directly before a thing, by the place they give to a drawn form."""
WITHIN = frozenset(PLACES["inside"])
PREPOSITIONS = frozenset(word for words in PLACES.values() for word in words)
BEFORE_NOUNS = frozenset(("around", "round", "inside", "within", "along", "beside", "across"))
"""Words after which a noun without an article names the thing: "8 inside bunker"."""
LONGEST_NAME = 3
DEFINITE = frozenset(("the", "this", "that", "these", "those", "my", "our", "your"))
"""Determiners that begin a phrase for a thing after a preposition."""
OUTWARD = frozenset(("off", "away", "clear", "out", "outside"))
"""Words that make a distance one to keep outside the thing."""


def read_instruction(text: str, metres_per_pixel: float | None = None) -> Reading:
    """Read an English instruction about a picture whose scale may be None, if it is not known."""
    form, span = form_in(text)
    words = tokens(text)
    tagging = tag(words)
    meaning = weighed(tagging.meaning, items_of(text, words, tagging))
    known = may_command([w.text for w in words], max(meaning, key=lambda m: meaning[m]))
    tagging = tag(words, known)
    items = [_drawn(item, span) for item in items_of(text, words, tagging)]
    meaning = meaning_of(words, tagging, items)
    meanings = sorted(meaning.items(), key=lambda m: -m[1])
    stops = tuple((kind, " ".join(text[a:b].split())) for kind, a, b in stops_in(items))
    language = foreign_language([w.text for w in words]) or ""
    reading = Reading(meanings, form=form, stops=stops, language=language)
    return _Reader(text, items, reading, metres_per_pixel).read()


def _drawn(item: Item, span: tuple[int, int]) -> Item:
    """Return the item, or a blank where it is part of the words for a drawn form."""
    if span[0] <= item.start < span[1]:
        return Item("<f>", item.start, item.end, "demand", 1.0)
    return item


class _Reader:
    """Applies the rules to the items of an instruction and accounts for each."""

    def __init__(
        self, text: str, items: Sequence[Item], reading: Reading, metres_per_pixel: float | None
    ) -> None:
        self.text, self.items, self.reading = text, items, reading
        self.fields = Fields(text, items, reading, metres_per_pixel)
        self.taken = [item.symbol == "<f>" for item in items]
        self.classes = [frozenset(c) for c in word_classes([item.symbol for item in items])]
        self.barring = Barring(items, self.classes)
        self.clauses, self.prevented = self.barring.clauses, self.barring.prevented
        self.demands = tuple(
            d
            for d in demands_in(items)
            if d.numbers
            or d.sides
            or d.sets in PURPOSES
            or not self.prevented.issuperset(range(d.first, d.last))
        )
        self.scenery = self._scenery()

    def read(self) -> Reading:
        """Return the reading, including what no rule took."""
        self._settle_meaning()
        for demand in self.demands:
            if not self.fields.apply(demand):
                self.reading.unread.append(self._quote(demand.first, demand.last))
            elif demand.sets not in OF_OTHERS:  # what it names is the target
                self.fields.mentioned += range(demand.first, demand.last)
            self.taken[demand.first : demand.last] = [True] * (demand.last - demand.first)
        for demand in self.fields.unsettled():
            self.reading.unread.append(self._quote(demand.first, demand.last))
        self._count_corners()
        self._refer()
        self.reading.place = self._place()
        self._count_alone()
        self._account()
        return self.reading

    def _count_corners(self) -> None:
        """Take the number of corners as that of robots where the words give none."""
        named = self.fields.corners
        if self.reading.robots is None and len(named) == 1:
            self.reading.robots = named[0]
        self.reading.unread += [f"{n} corners" for n in named if n not in (4, self.reading.robots)]

    def _scenery(self) -> list[bool]:
        """Return for each item whether its sentence only sets the scene for one that commands."""
        demanded = {k for d in self.demands for k in range(d.first, d.last)}
        scenic: list[bool] = []
        goes_on = False
        for sentence in sentences(self.items):
            place = range(len(scenic), len(scenic) + len(sentence))
            words = [i for i in sentence if i.symbol[0].isalnum() or i.symbol == "<t>"]
            aside = [i for i in words if i.label in ("background", "thing")]
            says = {*CLASSES_OF.get(self.reading.relation, ()), "place", "robot"} - VAGUE
            weighty = any(i.symbol in WEIGHTY for i in sentence)
            share = WEIGHTY_SCENIC if weighty else SCENIC
            calls = sentence[-1].symbol == "!" and len(words) <= LONGEST_CALL
            states = calls or any(i.symbol in STATING for i in sentence)
            if states and not weighty and not any(self.classes[k] & says for k in place):
                share = 0.0
            if goes_on:
                share = 1.0
            goes_on = sentence[-1].symbol == ";"
            counts = [
                k for k in place if self.items[k].quantity and not self._is_background_number(k)
            ]
            if demanded & {*place} or counts:
                share = 1.0
            ordered = any(d.sets == "robots" and d.first in place for d in self.demands)
            if sentence[-1].symbol == "?" and not ordered:
                share = 0.0
            scenic += [bool(words) and len(aside) >= share * len(words)] * len(sentence)
        return scenic if not all(scenic) else [False] * len(self.items)

    def _settle_meaning(self) -> None:
        """Put the arrangement that the demands force first: a named form, a row at a named side."""
        reading = self.reading
        sets = {d.sets for d in self.demands}
        forced = "cage" if self.barring.closes(reading, self.demands) else None
        if reading.form is not None or "form" in sets:
            forced = "shape"
        elif self._parts():
            forced = "between"
        else:
            forced = forced or self._demanded(sets)
        if forced and reading.relation != "ask":
            reading.meanings = [(forced, 1.0), *reading.meanings]

    def _demanded(self, sets: set[str]) -> str | None:
        """Return the arrangement that the demands call for if the command says another, or None."""
        reading = self.reading
        rings = {"rings", "rings_of"}, ("several", "shape"), ("around", "cage", "along")
        besides = {"further"}, ("several", "centre"), ("around", "cage", "corners")
        for named, instead, likely in (rings, besides):
            if sets & named and reading.relation in instead:
                return next(m for m, _ in reading.meanings if m in likely)
        if sets & RINGS and reading.relation not in ("around", "cage", "ask"):
            return "around"
        rows = "groups" in sets and reading.relation in ("several", "around", "along")
        if rows or ("each_side" in sets and not self._surrounds()):
            return "along"
        if "atop" in sets and reading.relation in ("several", "along", "around"):
            return "inside"
        if reading.relation in ("around", "cage", "inside") and self._stands_off():
            within = any(item.symbol in WITHIN for item in self.items)
            kept = reading.sure and (within or reading.relation != "inside")
            return reading.relation if kept else "around"
        unsure = not reading.sure and reading.relation != "ask"
        return "along" if "side" in sets and unsure else None

    def _surrounds(self) -> bool:
        """Return whether a command word by itself says all round: "surround it, four a side"."""
        sided = [range(d.first, d.last) for d in self.demands if d.sets == "each_side"]
        return any(
            item.label == "command" and "surround" in self.classes[k]
            for k, item in enumerate(self.items)
            if not any(k in span for span in sided)
        )

    def _stands_off(self) -> bool:
        """Return whether a distance is to be kept outside the thing: "20 px off"."""
        kept = [d for d in self.demands if d.sets == "clearance"]
        said = {i.symbol for d in kept for i in self.items[d.first : d.last]}
        return bool(said & OUTWARD)

    def _parts(self) -> bool:
        """Return whether the command says "between", which settles the arrangement."""
        lengths = [range(d.first, d.last) for d in self.demands if d.sets in LENGTHS]
        return any(
            item.symbol == "between"
            and item.label == "command"
            and not any(k in r for r in lengths)
            for k, item in enumerate(self.items)
        ) and (dict(self.reading.meanings).get("between", 0) >= MAY_BE)

    def _refer(self) -> None:
        """Sort the phrases for things: the arrangement is about those that no demand took."""
        for k, item in enumerate(self.items):
            if item.symbol == "<t>" and (not self.taken[k] or k in self.fields.mentioned):
                phrase = self._quote(k, self.fields.reaches.get(k, k + 1))
                self.taken[k] = True
                first = phrase.lower().split()[0]
                if k in self.prevented and self.reading.relation == "cage":
                    self.taken[k] = False
                elif says_others(phrase):
                    self.reading.background.append(phrase)
                elif self._demands(phrase) or (self.reading.things and not may_open(first)):
                    self.reading.unread.append(phrase)
                else:
                    self.reading.things.append(phrase)

    def _demands(self, phrase: str) -> bool:
        """Return whether a phrase for a thing says more than which, or where else robots stand."""
        outside = self.reading.relation not in ("inside", "centre")
        return says_more(phrase) or (outside and says_inside(phrase))

    def _place(self) -> str:
        """Return where a form is drawn, by the word before the thing; "" where it does not say."""
        for k, item in enumerate(self.items):
            before = self.items[k - 1].symbol if k else ""
            if item.symbol in ("<t>", "it", "this", "that"):
                place = next((p for p, words in PLACES.items() if before in words), "")
                if place and self.reading.form is not None:
                    self.taken[k - 1] = True
                return place
        return ""

    def _count_alone(self) -> None:
        """Take a number that stands alone as the robot count where nothing else gives one."""
        free = [k for k, i in enumerate(self.items) if i.symbol == "<n>" and not self.taken[k]]
        aside = ("background", "thing")
        free = [k for k in free if all(i.label not in aside for i in self.items[k : k + 2])]
        known = self.reading.robots is not None or self.reading.one_a_corner
        if not (known or self.reading.odd_count) and len(free) == 1:
            quantity = self.items[free[0]].quantity
            if quantity is not None and quantity.whole is not None:
                self.reading.robots = quantity.whole
                self.taken[free[0]] = True

    def _account(self) -> None:
        """Sort the words that nothing took into background and unread."""
        kinds = [self._kind(k) for k in range(len(self.items))]
        for first, last in self._runs():
            within = kinds[first:last]
            if "unread" in within:
                self._account_unread(first, last)
                continue
            aside = [k for k in range(first, last) if kinds[k] == "background"]
            said = {self.items[k].symbol for k in aside}
            if said - fillers() - REASONS:
                reading = self.reading
                sort = reading.unread if said & LINES and "a" in said else reading.background
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

    def _is_bare(self, first: int, last: int) -> bool:
        """Return whether words are a noun, perhaps with adjectives, without an article."""
        words = [i.symbol for i in self.items[first:last]]
        plain = all(w.isalpha() and w not in WEIGHTY | fillers() for w in words)
        telling = any(self.classes[k] & ASKED_CLASSES - {"motion"} for k in range(first, last))
        return plain and not telling and 0 < len(words) <= LONGEST_NAME

    def _only_names(self, first: int, last: int) -> bool:
        """Return whether words can be a phrase for a thing that says nothing else."""
        says = any(i.quantity or i.symbol in NEGATIONS for i in self.items[first:last])
        return not says and not self._demands(self._quote(first, last))

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
            return (
                ""
                if self._counts_corners(item)
                else "background"
                if self._is_background_number(k)
                else "unread"
            )
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

    def _is_background_number(self, k: int) -> bool:
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
