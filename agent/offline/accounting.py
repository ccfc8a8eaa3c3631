"""Reader that turns an instruction into fields of a contract and accounts for every word.

Each word is taken by one rule, refers to a thing, is a known word of the command, is background
that is quoted back to the person, or is left unread: then the planner quotes it and asks.
"""

import re
from collections.abc import Iterable, Sequence

from .barring import MAY_BE, Barring
from .demand_fields import LENGTHS, Fields
from .demands import (
    PURPOSES,
    Item,
    demands_in,
    items_of,
    says_others,
    sentences,
    stops_in,
)
from .drawn_forms import form_in
from .evidence import meaning_of, weighed
from .languages import foreign_language
from .leftovers import PLACES, Leftovers, demands_more
from .lexicon import CLASSES_OF, WEIGHTY, may_command
from .reading import Reading
from .spans import may_open
from .tagging import tag, tokens, word_classes

SCENIC, WEIGHTY_SCENIC = 0.4, 0.5
"""Least share of non-command words that makes a sentence background; second: a weighty one."""
OF_OTHERS = frozenset(
    ("keep_out", "faced", "left_alone", "rings_of", "aimed_opening", "keep_off_by")
)
"""Demands that name a thing other than the one the arrangement is about."""
LONGEST_CALL = 3
"""Most words of an exclamation that only addresses somebody: "Ball boys!"."""
RINGS = frozenset(("ring", "radius", "diameter"))
"""Demands that only a ring can meet."""
STATING = frozenset(
    ("is", "are", "was", "were", "has", "have", "had", "could", "might", "will", "it's", "there's")
)
"""Words that mark a sentence as a statement."""
VAGUE = {"nobody", "area"}
"""Classes of everyday words: a sentence with no others does not name an arrangement."""
WITHIN = frozenset(PLACES["inside"])
ON_A_SIDE = re.compile(
    r"\b(?:on|to|at|from) (?:the |its )?(?:left|right|top|bottom)$", re.IGNORECASE
)
CORRECTED = re.compile(r"\w\W*[.,;-]\s*(sorry|no wait|i mean|oops)\s*,", re.IGNORECASE)
"""Words within an instruction that take something back; what is left of it cannot be told."""
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
    if (put_right := CORRECTED.search(text)) is not None:
        stops = (*stops, ("a correction", put_right[1]))
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
        self.leftovers = Leftovers(text, items, reading, self.classes, self.taken, self.barring)
        self.leftovers.scenery = self._scenery()

    def read(self) -> Reading:
        """Return the reading, including what no rule took."""
        self._settle_meaning()
        for demand in self.demands:
            if not self.fields.apply(demand):
                self.reading.unread.append(self._quote(demand.first, demand.last))
            elif demand.sets not in OF_OTHERS:
                self.fields.mentioned += range(demand.first, demand.last)
            self.taken[demand.first : demand.last] = [True] * (demand.last - demand.first)
        tips = self.fields.pointing if self.reading.form is not None else []
        for demand in [*self.fields.unsettled(), *tips]:  # "a V pointing at it": its tip
            self.reading.unread.append(self._quote(demand.first, demand.last))
        self._count_corners()
        self._refer()
        self.reading.place = self._place()
        self._count_alone()
        self.leftovers.account()
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
                k
                for k in place
                if self.items[k].quantity and not self.leftovers.is_background_number(k)
            ]
            if demanded & {*place} or counts or self._arranges(place):
                share = 1.0
            ordered = any(d.sets == "robots" and d.first in place for d in self.demands)
            if sentence[-1].symbol == "?" and not ordered:
                share = 0.0
            scenic += [bool(words) and len(aside) >= share * len(words)] * len(sentence)
        return scenic if not all(scenic) else [False] * len(self.items)

    def _arranges(self, place: Iterable[int]) -> bool:
        """Return whether a word of the command there says the arrangement."""
        says = {*CLASSES_OF.get(self.reading.relation, ())} - VAGUE
        return any(self.items[k].label == "command" and self.classes[k] & says for k in place)

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
        if forced and (reading.relation != "ask" or "all_round" in sets):
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
        if "faced" in sets and reading.relation == "around" and not self._surrounds():
            return "along"
        opens = sets & {"opening", "aimed_opening"} and self._surrounds("enclose")
        if opens and reading.relation == "along":
            return next(m for m, _ in reading.meanings if m in ("around", "cage"))
        rows = "groups" in sets and reading.relation in ("several", "around", "along")
        if rows or ("each_side" in sets and not self._surrounds()):
            return "along"
        if "atop" in sets and reading.relation in ("several", "along", "around"):
            return "inside"
        if reading.relation in ("around", "cage", "inside") and self._stands_off():
            within = any(item.symbol in WITHIN for item in self.items)
            kept = reading.sure and (within or reading.relation != "inside")
            return reading.relation if kept else "around"
        if "all_round" in sets and reading.relation in ("ask", "several"):
            return "around"
        unsure = not reading.sure and reading.relation != "ask"
        return "along" if "side" in sets and unsure else None

    def _surrounds(self, *kinds: str) -> bool:
        """Return whether a command word by itself says all round: "surround it, four a side"."""
        sided = [range(d.first, d.last) for d in self.demands if d.sets == "each_side"]
        return any(
            item.label == "command" and self.classes[k] & {"surround", *kinds}
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
        if any(
            d.sets == "two_things" and self.items[d.first].symbol == "from" for d in self.demands
        ):
            return True
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
                elif (
                    demands_more(phrase, self.reading.relation)
                    or (self.reading.things and not may_open(first))
                    or self._says_where(k, phrase)
                ):
                    self.reading.unread.append(phrase)
                else:
                    self.reading.things.append(phrase)

    def _says_where(self, k: int, phrase: str) -> bool:
        """Return whether one of several phrases may say the side of a row that has none yet."""
        reading, others = self.reading, [i for i in self.items if i.symbol == "<t>"]
        rows = reading.relation == "along" and "side" not in reading.group and not reading.faced
        later = self.items[k] is not others[-1]
        return rows and len(others) > 1 and later and ON_A_SIDE.search(phrase) is not None

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

    def _quote(self, first: int, last: int) -> str:
        return " ".join(self.text[self.items[first].start : self.items[last - 1].end].split())
