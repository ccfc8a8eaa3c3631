"""An instruction in words to the fields of a contract, with an account of every word.

Each word is taken by one rule, refers to a thing, is a known word of the command, is background
that is repeated to the person, or is left unread: then the planner asks and quotes it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any

from .demands import Demand, Item, demands_in, items_of, says_more, sentences, stops_in
from .drawn_forms import Form, form_in
from .tagging import in_use, stem, tag, tokens, word_classes

FARTHEST = 100_000
"""Stands for no upper bound of a clearance, px."""
SURE = 0.55
"""Least probability of an arrangement that is carried out unasked, fitted on other authors."""
SURE_BACKGROUND = 0.5
SCENIC = 0.4
"""Share of a sentence's words that are no command from which on all of it is background."""
OPPOSITE = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}
OPENS = {
    "left": "left",
    "right": "right",
    "top": "up",
    "bottom": "down",
    "up": "up",
    "down": "down",
}
DEGREES = {"right": 0, "bottom": 90, "down": 90, "left": 180, "top": 270, "up": 270}
PLACES = {
    "around": ("around", "round", "about"),
    "inside": ("inside", "in", "on", "within", "over", "across", "onto", "into"),
    "along": ("beside", "by", "near", "at", "to"),
}
"""Words directly before a thing, and where a form is drawn then."""
CLASSES_OF = {
    "around": ("surround", "ring", "enclose", "enclosure"),
    "cage": ("enclose", "enclosure", "surround", "ring", "prevent", "nobody"),
    "inside": ("spread", "area"),
    "along": ("row",),
    "corners": ("corner",),
    "between": ("part",),
    "centre": ("gather", "middle"),
    "shape": ("form",),
}
DEMANDING = frozenset(
    {"gap", "face", "avoid", "wait", "motion", "each", "rest", "far", "near", "side", "figure"}
)
"""Classes whose words say more than an arrangement: a rule takes them, or they are asked."""
CLOSING = {"enclose", "enclosure", "prevent"}
MAY_CLOSE = 0.2
"""Least probability of a cage for one of these classes to settle it."""
NEUTRAL = ("place", "robot", "polite")
"""Classes of classes.yaml whose words say an arrangement, or none."""
ENDS = frozenset(",.;:!?()")
"""Signs at which a stretch of words that was not understood ends."""
HEAVY = frozenset(
    "each every both either neither not no none nobody never except without only instead half rest "
    "other others another first last don't doesn't isn't aren't can't cannot mustn't won't shouldn't "
    "nothing anything everything left right top bottom upper lower north south east west middle "
    "big small large huge wide narrow part parts".split()
)
"""Small words that change who is meant, how many or whether: a rule takes them or they are asked."""
NEGATIONS = frozenset(
    "no not none nobody nothing never without don't doesn't can't cannot mustn't won't shouldn't "
    "anything isn't aren't".split()
)
"""What a closed ring is to prevent is said with these."""
LEAST_BARE = 5
"""Numbers without a unit below this, px, are hardly lengths."""
LENGTHS = ("clearance", "pitch", "min_spacing", "max_gap", "radius", "diameter", "opening")


@dataclass
class Reading:
    """What was understood of an instruction.

    Attributes:
        meanings: arrangements that may be meant with their probabilities, likeliest first.
        robots: how many; None where the words do not say.
        odd_count: words for a number of robots that is none, or "".
        group: fields of the contract's group beside relation, targets and robots. Lengths px.
        robot_radius: px, where the words state it.
        shares: numbers of robots on sides, where the words part them so; 0 for an equal share.
        rings: how many rings or rows, one outside the other.
        form: what the robots draw, where they draw something.
        place: around, inside or along, where words stand before the thing that say so of a form.
        things: phrases for the thing or things that the arrangement is about.
        others: phrases for things to stay clear of.
        faced: phrase for the thing that the side of a row faces, or "".
        stops: why it is no order to place robots now, each a kind and the words for it.
        unread: words that no rule took.
        background: words that change nothing.
        unscaled: metric lengths that a picture without a scale says nothing of.
    """

    meanings: list[tuple[str, float]]
    robots: int | None = None
    odd_count: str = ""
    group: dict[str, Any] = field(default_factory=dict[str, Any])
    robot_radius: float | None = None
    shares: list[tuple[str, int]] = field(default_factory=list[tuple[str, int]])
    rings: int = 1
    form: Form | None = None
    place: str = ""
    things: list[str] = field(default_factory=list[str])
    others: list[str] = field(default_factory=list[str])
    faced: str = ""
    stops: tuple[tuple[str, str], ...] = ()
    unread: list[str] = field(default_factory=list[str])
    background: list[str] = field(default_factory=list[str])
    unscaled: list[str] = field(default_factory=list[str])

    @property
    def relation(self) -> str:
        """The likeliest arrangement."""
        return self.meanings[0][0]

    @property
    def sure(self) -> bool:
        """Whether it is likely enough to be carried out unasked."""
        return self.meanings[0][1] >= SURE


def read_instruction(text: str, metres_per_pixel: float | None = None) -> Reading:
    """Read an instruction in English about a picture of a scale, if it has one."""
    form, span = form_in(text)
    words = tokens(text)
    tagging = tag(words)
    relation = max(tagging.meaning, key=lambda m: tagging.meaning[m])
    known = _known_words([w.text for w in words], relation)
    tagging = tag(words, known)
    items = [_drawn(item, span) for item in items_of(text, words, tagging)]
    meanings = sorted(tagging.meaning.items(), key=lambda m: -m[1])
    stops = tuple((kind, " ".join(text[a:b].split())) for kind, a, b in stops_in(items))
    reading = Reading(meanings, form=form, stops=stops)
    return _Reader(text, items, reading, metres_per_pixel).read()


def _drawn(item: Item, span: tuple[int, int]) -> Item:
    """The item, or a blank where it is part of the words for a drawn form."""
    if span[0] <= item.start < span[1]:
        return Item("<f>", item.start, item.end, "demand", 1.0)
    return item


def _known_words(words: Sequence[str], relation: str) -> list[bool]:
    """For each word whether it can be part of a command for an arrangement."""
    return [
        not word[0].isalpha()
        or word in _fillers()
        or word in HEAVY
        or bool(set(classes) & DEMANDING)
        or goes_with(word, set(classes), relation)
        for word, classes in zip(words, word_classes(words), strict=True)
    ]


def goes_with(word: str, classes: set[str], relation: str) -> bool:
    """Whether a word goes with an arrangement: by the thesaurus or in other commands."""
    if classes & {*CLASSES_OF.get(relation, ()), *NEUTRAL}:
        return True
    meanings = in_use().words.get(stem(word), frozenset())
    others = {c for r, named in CLASSES_OF.items() if r != relation for c in named}
    return relation in meanings or (bool(meanings) and not classes & (others | DEMANDING))


class _Reader:
    """Applies the rules to the items of an instruction and accounts for each."""

    def __init__(
        self, text: str, items: Sequence[Item], reading: Reading, metres_per_pixel: float | None
    ) -> None:
        self.text, self.items, self.reading = text, items, reading
        self.scale = metres_per_pixel
        self.taken = [item.symbol == "<f>" for item in items]
        self.classes = [set(c) for c in word_classes([item.symbol for item in items])]
        self.demands = demands_in(items)
        self.scenery = self._scenery()

    def read(self) -> Reading:
        """The reading, with what no rule took."""
        self._settle_meaning()
        for demand in self.demands:
            if self._apply(demand):
                self.taken[demand.first : demand.last] = [True] * (demand.last - demand.first)
        self._refer()
        self.reading.place = self._place()
        self._count_alone()
        self._account()
        return self.reading

    def _scenery(self) -> list[bool]:
        """For each item whether its sentence only sets the scene, beside one that commands."""
        demanded = {k for d in self.demands for k in range(d.first, d.last)}
        scenic: list[bool] = []
        for sentence in sentences(self.items):
            place = range(len(scenic), len(scenic) + len(sentence))
            words = [i for i in sentence if i.symbol[0].isalnum() or i.symbol == "<t>"]
            aside = [i for i in words if i.label in ("background", "thing")]
            weighs = demanded & {*place} or any(
                i.quantity or i.symbol in HEAVY or "robot" in self.classes[k]
                for k, i in zip(place, sentence, strict=True)
            )
            share = 1.0 if weighs else SCENIC
            scenic += [bool(words) and len(aside) >= share * len(words)] * len(sentence)
        return scenic if not all(scenic) else [False] * len(self.items)

    def _settle_meaning(self) -> None:
        """A form that is named is drawn, and a side that is named takes a row."""
        reading = self.reading
        sets = {d.sets for d in self.demands}
        forced = "cage" if self._closes() else None
        if reading.form is not None or "form" in sets:
            forced = "shape"
        elif self._parts():
            forced = "between"
        elif "rings" in sets and reading.relation in ("several", "shape"):
            forced = next(m for m, _ in reading.meanings if m in ("around", "cage", "along"))
        elif "groups" in sets and reading.relation in ("several", "around"):
            forced = "along"
        if forced and reading.relation != "ask":
            reading.meanings = [(forced, 1.0), *reading.meanings]

    def _parts(self) -> bool:
        """Whether the command says between: the arrangement is no other then."""
        return any(i.symbol == "between" and i.label == "command" for i in self.items) and (
            dict(self.reading.meanings).get("between", 0) >= MAY_CLOSE
        )

    def _closes(self) -> bool:
        """Whether a command for a ring has a word that closes it: a barrier all round."""
        likely = dict(self.reading.meanings).get("cage", 0)
        if self.reading.relation == "around" and self._prevents():
            return True
        closing = any(
            classes & CLOSING and not classes & {"surround", "ring"}
            for classes, item in zip(self.classes, self.items, strict=True)
            if item.label == "command"
        )
        return self.reading.relation == "around" and closing and likely >= MAY_CLOSE

    def _prevents(self) -> bool:
        """Whether a sentence says that something must not get in or out."""
        at = 0
        for sentence in sentences(self.items):
            kinds = self.classes[at : at + len(sentence)]
            at += len(sentence)
            negated = any(i.symbol in NEGATIONS for i in sentence if i.symbol != "<t>")
            if negated and any("prevent" in classes for classes in kinds):
                return True
        return False

    # One demand after another.

    def _apply(self, demand: Demand) -> bool:
        """Carry a demand over into the reading; False where it cannot be."""
        if demand.sets in LENGTHS or demand.sets in ("robot_radius", "robot_diameter"):
            return self._length(demand)
        return bool(getattr(self, f"_{demand.sets}", lambda _: False)(demand))

    def _set(self, name: str, value: Any) -> bool:
        """Set a field, unless the words said something else of it before."""
        group = self.reading.group
        if group.get(name, value) != value:
            return False
        group[name] = value
        return True

    def _length(self, demand: Demand) -> bool:
        quantity, relation = demand.quantity, self.reading.relation
        if quantity is None:
            return demand.sets == "opening" and self._opening(demand, 0.0)
        bare = quantity.kind == "number" and self.scale is None and quantity.least >= LEAST_BARE
        if not bare and quantity.kind == "m" and self.scale is None:
            self.reading.unscaled.append(quantity.wording)
            return False
        if not (bare or quantity.is_length):
            return False
        low, high = (quantity.least, quantity.most) if bare else quantity.px(self.scale) or (0, 0)
        if self._other(demand) is not None or (low <= 0 and demand.sets != "clearance"):
            return False
        if demand.sets == "clearance":
            return relation not in ("between", "centre") and self._clearance(demand, low, high)
        if demand.sets == "opening":
            return self._opening(demand, low)
        if demand.sets.startswith("robot"):
            self.reading.robot_radius = low / 2 if demand.sets == "robot_diameter" else low
            return low == high
        if demand.sets in ("radius", "diameter"):
            radius = low / 2 if demand.sets == "diameter" else low
            return relation in ("around", "cage") and low == high and self._set("radius", radius)
        return self._spaced(demand, low, high)

    def _spaced(self, demand: Demand, low: float, high: float) -> bool:
        name = demand.sets
        if name == "pitch" and demand.bound:
            name = "min_spacing" if demand.bound == "least" else "max_gap"
        if name == "pitch" and low < high:
            return self._set("min_spacing", low) and self._set("max_gap", high)
        return self._set(name, low if name != "max_gap" else high)

    def _clearance(self, demand: Demand, low: float, high: float) -> bool:
        if low < 0:
            return False
        inside = self.reading.relation == "inside"
        if demand.bound == "most":
            return self._set("clearance", [0.0, high])
        if demand.bound == "least" or (inside and low == high):
            return self._set("clearance", [low, FARTHEST])
        return self._set("clearance", [low, high if high > low else low + 1])

    def _opening(self, demand: Demand, width: float) -> bool:
        side = next(iter(demand.sides), None)
        if self.reading.relation == "shape":
            opens = OPENS.get(side or "")
            return not width and opens is not None and self._set("opens", opens)
        if self.reading.relation not in ("around", "cage"):
            return False
        self.reading.meanings = [("around", 1.0), *self.reading.meanings]
        where = {"up": "top", "down": "bottom"}.get(side or "", side)
        return self._set("opening", width) and (
            where is None or self._set("opening_towards", where)
        )

    def _free_side(self, demand: Demand) -> bool:
        others = [s for s in OPPOSITE if s != demand.sides[0]]
        return self.reading.relation in ("around", "cage") and self._only(others)

    def _only_side(self, demand: Demand) -> bool:
        relation = self.reading.relation
        if relation == "along":
            return self._side(demand)
        return relation == "around" and self._only([demand.sides[0]])

    def _half(self, demand: Demand) -> bool:
        self.reading.meanings = [("around", 1.0), *self.reading.meanings]
        return self._only([f"{demand.sides[0]} half"])

    def _only(self, sides: list[str]) -> bool:
        self.reading.meanings = [("around", 1.0), *self.reading.meanings]
        return self._set("sides", sides)

    def _heading(self, demand: Demand) -> bool:
        return self._other(demand) is None and self._set("heading", demand.value)

    def _heading_side(self, demand: Demand) -> bool:
        return self._set("heading", DEGREES[demand.sides[0]])

    def _heading_angle(self, demand: Demand) -> bool:
        return demand.quantity is not None and self._set("heading", demand.quantity.least % 360)

    def _form(self, demand: Demand) -> bool:
        names = {"v": "a V", "u": "a U", "arc": "an arc"}
        if self.reading.form is not None:
            return False
        self.reading.form = Form({"kind": demand.value}, names[demand.value])
        return True

    def _keep_out(self, demand: Demand) -> bool:
        other = self._other(demand)
        if other is None:
            return self.reading.relation in ("around", "cage", "along", "corners")
        self.reading.others.append(other)
        return True

    def _faced(self, demand: Demand) -> bool:
        other = self._other(demand)
        if other is None or self.reading.relation != "along" or self.reading.faced:
            return False
        self.reading.faced = other
        return True

    def _other(self, demand: Demand) -> str | None:
        """The phrase in a demand for a thing that is not the one the arrangement is about."""
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
        return words - _fillers()

    def _groups(self, demand: Demand) -> bool:
        counts = [q.whole or 0 for q in demand.numbers] or [0, 0]
        if len(demand.sides) != 2 or len(counts) != 2 or self.reading.shares:
            return False
        self.reading.shares = list(zip(demand.sides, counts, strict=True))
        if all(counts):
            self._robots_are(sum(counts))
        return True

    def _rings(self, demand: Demand) -> bool:
        count = next((q.whole for q in demand.numbers), 2)
        if count is None or self.reading.rings > 1:
            return False
        self.reading.rings = count
        return self.reading.relation in ("around", "cage", "along")

    def _robots(self, demand: Demand) -> bool:
        number = next((q for q in demand.numbers if q.kind in ("number", "compound")), None)
        if number is None:
            return False
        if number.whole == 1 and self.reading.relation == "corners":
            return True
        if number.whole is None:
            self.reading.odd_count = self._quote(demand.first, demand.last)
            return True
        return self._robots_are(number.whole)

    def _robots_are(self, count: int) -> bool:
        if self.reading.robots not in (None, count):
            return False
        self.reading.robots = count
        return True

    def _located(self, demand: Demand) -> bool:
        return self._follows_thing(demand)

    def _all_round(self, demand: Demand) -> bool:
        return self.reading.relation in ("around", "cage")

    def _abreast(self, demand: Demand) -> bool:
        return self.reading.relation in ("along", "between")

    def _adverb(self, demand: Demand) -> bool:
        return True

    def _at_each(self, demand: Demand) -> bool:
        return self.reading.relation == "corners" and all(q.least in (1, 4) for q in demand.numbers)

    def _one_each(self, demand: Demand) -> bool:
        return self.reading.relation == "corners" and all(q.least == 1 for q in demand.numbers)

    def _side(self, demand: Demand) -> bool:
        side = demand.value or demand.sides[0]
        relation = self.reading.relation
        if relation == "around" and len(self.reading.meanings) > 1:
            likely = dict(self.reading.meanings)
            if likely.get("along", 0) > 0.3:
                self.reading.meanings = [("along", 1.0), *self.reading.meanings]
                relation = "along"
        if relation in ("along", "shape") and self._set("side", side):
            return True
        return self._follows_thing(demand)

    def _follows_thing(self, demand: Demand) -> bool:
        """Whether words say which thing: "the white trailer on the left"."""
        before = [i.symbol for i in self.items[max(demand.first - 2, 0) : demand.first]]
        return before[-1:] == ["<t>"] or before == ["<t>", ","]

    def _spacing(self, demand: Demand) -> bool:
        return self._set("spacing", demand.value)

    def _fit(self, demand: Demand) -> bool:
        return self._set("fit", demand.value)

    def _closure(self, demand: Demand) -> bool:
        return self.reading.relation == "cage" and self._set("closure", demand.value)

    def _layout(self, demand: Demand) -> bool:
        return self.reading.relation == "between" and self._set("layout", demand.value)

    # What is left of the words.

    def _refer(self) -> None:
        """Phrases for things: the arrangement is about those that no demand took."""
        for k, item in enumerate(self.items):
            if item.symbol == "<t>" and not self.taken[k]:
                phrase = self._quote(k, k + 1)
                self.taken[k] = True
                if says_more(phrase):
                    self.reading.unread.append(phrase)
                else:
                    self.reading.things.append(phrase)

    def _place(self) -> str:
        """What stands before the thing says where a form is drawn."""
        for k, item in enumerate(self.items):
            before = self.items[k - 1].symbol if k else ""
            if item.symbol in ("<t>", "it", "this", "that"):
                return next((p for p, words in PLACES.items() if before in words), "")
        return ""

    def _count_alone(self) -> None:
        """A number that stands alone counts the robots where nothing else does."""
        free = [k for k, i in enumerate(self.items) if i.symbol == "<n>" and not self.taken[k]]
        if self.reading.robots is None and not self.reading.odd_count and len(free) == 1:
            quantity = self.items[free[0]].quantity
            if quantity is not None and quantity.whole is not None:
                self.reading.robots = quantity.whole
                self.taken[free[0]] = True

    def _account(self) -> None:
        """Sort what nothing took into background and unread."""
        kinds = [self._kind(k) for k in range(len(self.items))]
        for first, last in self._runs():
            within = kinds[first:last]
            if "unread" in within:
                self.reading.unread.append(self._quote(first, last))
                continue
            aside = [k for k in range(first, last) if kinds[k] == "background"]
            if aside:
                self.reading.background.append(self._quote(aside[0], aside[-1] + 1))

    def _runs(self) -> Iterator[tuple[int, int]]:
        """Runs of words that no rule took, up to the signs and demands about them."""
        open_ = [
            not self.taken[k] and item.symbol not in ENDS for k, item in enumerate(self.items)
        ]
        start = 0
        while start < len(open_):
            end = start
            while end < len(open_) and open_[end]:
                end += 1
            if end > start:
                yield start, end
            start = max(end, start + 1)

    def _kind(self, k: int) -> str:
        """Of an item: "" where it is accounted for, else filler, background or unread."""
        item = self.items[k]
        if self.taken[k] or not (
            item.symbol[0].isalnum() or item.symbol in ("<n>", "<l>", "<a>", "<s>", "<c>")
        ):
            return ""
        if self.scenery[k]:
            return "background"
        if item.quantity is not None:
            return "" if self._counts_corners(item) else "unread"
        if item.label == "background" and item.certainty >= SURE_BACKGROUND:
            return "background"
        if item.symbol in HEAVY and not self._is_of_relation(k):
            return "unread"
        if item.symbol in _fillers():
            return "filler"
        known = goes_with(item.symbol, self.classes[k], self.reading.relation)
        return "" if known else "unread"

    def _counts_corners(self, item: Item) -> bool:
        """Four corners, one robot at each."""
        number = item.quantity and item.quantity.whole
        return self.reading.relation == "corners" and number in (1, 4, self.reading.robots)

    def _is_of_relation(self, k: int) -> bool:
        """Whether a word that weighs is what says the arrangement: "nobody", of a closed ring."""
        relation = self.reading.relation
        word = self.items[k].symbol
        if relation == "cage" and word in NEGATIONS:
            return True
        if relation == "corners" and word in ("each", "every"):
            return True
        return bool(self.classes[k] & {*CLASSES_OF.get(relation, ())})

    def _quote(self, first: int, last: int) -> str:
        return " ".join(self.text[self.items[first].start : self.items[last - 1].end].split())


@cache
def _fillers() -> frozenset[str]:
    text = resources.files(__package__ or "").joinpath("fillers.txt").read_text("utf-8")
    return frozenset(text.split())
