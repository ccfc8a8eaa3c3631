"""Demands of an instruction to fields of the contract, one rule after another."""

import re
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from .demands import Demand, Item
from .drawn_forms import Form
from .lexicon import fillers
from .reading import Reading
from .tagging import tokens, word_classes

FARTHEST = 100_000
"""Stands for no upper bound of a clearance, px."""
OPPOSITE = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}
LONG_SIDES = ("long", "longer", "short", "shorter")
OPENS = {side: side for side in ("left", "right", "up", "down")} | {"top": "up", "bottom": "down"}
COUNTING = frozenset(
    ("of", "in", "with", "using", "by", "use", "total", "altogether", "strong", "number")
)
"""Words about a number of robots that say nothing of their kind."""
DEGREES = {"right": 0, "bottom": 90, "down": 90, "left": 180, "top": 270, "up": 270}
LEAST_BARE = 5
"""Numbers without a unit below this, px, are hardly lengths."""
SEVERAL = re.compile(r"\b(?:two|three|four|five|six|both|pair|[a-z]+[^s\W]s)\b")
"""What a phrase for more than one thing has in it."""
LENGTHS = ("clearance", "pitch", "min_spacing", "max_gap", "radius", "diameter", "opening")


class Fields:
    """Carries demands over into a reading."""

    def __init__(
        self, text: str, items: Sequence[Item], reading: Reading, metres_per_pixel: float | None
    ) -> None:
        self.text, self.items, self.reading = text, items, reading
        self.scale = metres_per_pixel
        self.corners: list[int] = []  # how many corners the words name
        self.mentioned: list[int] = []  # items of demands whose phrases name it
        self.per_side: Demand | None = None  # so many on each side, whose number is to be settled
        self.some_sides: Demand | None = None
        self.reaches: dict[int, int] = {}  # of phrases for things that go on: past-the-last item

    def apply(self, demand: Demand) -> bool:
        """Carry a demand over into the reading; False where it cannot be."""
        if demand.sets in LENGTHS or demand.sets in ("robot_radius", "robot_diameter"):
            return self._length(demand)
        rule = getattr(self, f"_{demand.sets}", None)
        return rule is not None and bool(rule(demand))

    def _set(self, name: str, value: Any) -> bool:
        """Set a field, unless the words said something else of it before."""
        group = self.reading.group
        if group.get(name, value) != value:
            return False
        group[name] = value
        return True

    def _replace(self, name: str, value: Any) -> bool:
        self.reading.group[name] = value
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
        among = [i for i in self.items if i.symbol == "<t>"]
        if len(among) > 1 and self._other(demand) is not None:
            return False
        if low <= 0 and demand.sets != "clearance":
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

    def _length_alone(self, demand: Demand) -> bool:
        """A length that ends the words about a ring is its distance from the thing."""
        rings = self.reading.relation in ("around", "cage", "corners")
        return rings and self._length(replace(demand, sets="clearance"))

    def _every(self, demand: Demand) -> bool:
        """One robot every so many pixels."""
        if any(q.kind == "number" and q.whole != 1 for q in demand.numbers):
            return False
        return self._length(replace(demand, sets="pitch"))

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
        least, most = self.reading.group.get("clearance", (0.0, FARTHEST))
        if demand.bound == "most" and most == FARTHEST and least <= high:
            return self._replace("clearance", [least, high])
        if demand.bound == "least" and least == 0.0 and low <= most:
            return self._replace("clearance", [low, most])
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
        if relation in ("along", "shape"):
            return self._side(demand)
        return relation == "around" and self._only([demand.sides[0]])

    def _half(self, demand: Demand) -> bool:
        if any(q.whole is None or not self._robots_are(q.whole) for q in demand.numbers):
            return False
        return self._only([f"{demand.sides[0]} half"])

    def _only(self, sides: list[str]) -> bool:
        self.reading.meanings = [("around", 1.0), *self.reading.meanings]
        return self._set("sides", sides)

    def _heading(self, demand: Demand) -> bool:
        sole = [i.symbol for i in self.items].count("<t>") < 2
        return (sole or self._other(demand) is None) and self._set("heading", demand.value)

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
        named = [k for k in range(demand.first, demand.last) if self.items[k].symbol == "<t>"]
        if not named or self.reading.relation != "along" or self.reading.faced:
            return False
        self.reading.faced = self._quote(named[-1], named[-1] + 1)
        self.mentioned += named[:-1]
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
        return words - fillers()

    def _groups(self, demand: Demand) -> bool:
        sides, counts = dict.fromkeys(demand.sides), [q.whole or 0 for q in demand.numbers]
        if demand.value == "each" and not any(n > 1 for n in counts):
            counts = [1] * len(sides)
        counts = counts or [0] * len(sides)
        if len(sides) != len(counts) or self.reading.shares or not sides.keys() <= OPPOSITE.keys():
            return False
        self.reading.shares = list(zip(sides, counts, strict=True))
        return not all(counts) or self._robots_are(sum(counts))

    def _each_side(self, demand: Demand) -> bool:
        """Both sides, all four, or as many as the robots take that are so many on each."""
        said = {self.items[k].symbol for k in range(demand.first, demand.last)}
        if self.reading.shares or self.per_side is not None:
            return False
        if demand.value == "each" and not said & {"either", *LONG_SIDES}:
            self.per_side = demand
            return True
        per = demand.quantity.whole if demand.quantity else int(demand.value == "each")
        return self._on_sides(LONG_SIDES if demand.value != "all" else {*OPPOSITE}, said, per)

    def _on_sides(self, sides: Collection[str], said: set[str], per: int | None) -> bool:
        kind = "short" if said & {"short", "shorter"} else "long"
        both = [kind, f"other {kind}"]
        named = both if sides is LONG_SIDES else [*OPPOSITE]
        self.reading.shares = [(side, per or 0) for side in named]
        return per is not None and (not per or self._robots_are(per * len(named)))

    def _some_sides(self, demand: Demand) -> bool:
        """Three sides, which are named there or by the one that is left free."""
        self.reading.meanings = [("around", 1.0), *self.reading.meanings]
        self.some_sides = demand
        return not demand.sides or self._only([*demand.sides])

    def unsettled(self) -> list[Demand]:
        """The demands about sides that nothing else settles: how many they are, or which."""
        found: list[Demand] = []
        each, some, robots = self.per_side, self.some_sides, self.reading.robots
        if each is not None:
            per = each.quantity.whole if each.quantity else 1
            sides = {2: LONG_SIDES, 4: {*OPPOSITE}}.get((robots or 0) // (per or 1))
            if not (per and robots and sides and self._on_sides(sides, set(), per)):
                found.append(each)
        if some is not None:
            if len(self.reading.group.get("sides", ())) != some.numbers[0].whole:
                found.append(some)
        return found

    def _rows_of(self, demand: Demand) -> bool:
        """Two rows of five: a grid, or beside a thing one row outside the other."""
        rows, each = ([2, *(q.whole or 0 for q in demand.numbers)])[-2:]
        across = any(self.items[k].symbol == "columns" for k in range(demand.first, demand.last))
        if self.reading.relation == "along" and rows == 2:
            self.reading.rings, self.reading.ring_counts = 2, [each, each]
            return self._robots_are(2 * each)
        if self.reading.form is not None or not rows or not each:
            return False
        grid = {"kind": "grid", "rows": each if across else rows}
        self.reading.form = Form(grid, f"{rows} rows of {each}", rows * each)
        self.reading.meanings = [("shape", 1.0), *self.reading.meanings]
        return True

    def _further(self, demand: Demand) -> bool:
        """Robots beside the arrangement: "and one in the middle"."""
        count = demand.numbers[0].whole
        if not count or self.reading.relation not in ("around", "cage", "corners"):
            return False
        self.reading.further.append((next(iter(demand.sides), "centre"), count))
        return True

    def _rings(self, demand: Demand) -> bool:
        count = next((q.whole for q in demand.numbers), 2)
        if count is None or self.reading.rings > 1:
            return False
        self.reading.rings = count
        return self.reading.relation in ("around", "cage", "along")

    def _rings_of(self, demand: Demand) -> bool:
        """Two rings of six, or four in the inner ring and six in the outer one."""
        counts = [q.whole or 0 for q in demand.numbers]
        if demand.value == "alike":
            rings, counts = (2, counts * 2) if len(counts) == 1 else (counts[0], counts[1:] * 2)
        else:
            rings, counts = 2, counts[1:3] if counts[0] == 2 < len(counts) else counts[:2]
        known = self.reading.ring_counts or (self.reading.rings > 1 and rings != self.reading.rings)
        if known or rings != 2 or len(counts) != 2 or 0 in counts:
            return False
        self.reading.rings, self.reading.ring_counts = rings, counts
        return self.reading.relation in ("around", "cage") and self._robots_are(sum(counts))

    def _robots(self, demand: Demand) -> bool:
        number = next((q for q in demand.numbers if q.kind in ("number", "compound")), None)
        if number is None:
            return False
        if number.whole == 1 and self.reading.relation == "corners":
            return True
        if number.whole is None:
            self.reading.odd_count = self._quote(demand.first, demand.last)
            return True
        self._note_kind(demand)
        return self._robots_are(number.whole)

    def _note_kind(self, demand: Demand) -> None:
        """Words for the kind of robot, which change nothing: "24 small yellow robots"."""
        named = range(demand.first, demand.last)
        symbols = [self.items[k].symbol for k in named]
        kinds = word_classes(symbols)
        kept = [
            k
            for k, symbol, classes in zip(named, symbols, kinds, strict=True)
            if symbol[0].isalpha()
            and symbol not in fillers()
            and not {"robot", "rest"} & {*classes}
        ]
        kept = [k for k in kept if self.items[k].symbol not in COUNTING]
        if kept:
            self.reading.background.append(self._quote(kept[0], kept[-1] + 1))

    def _robots_are(self, count: int) -> bool:
        if self.reading.robots not in (None, count):
            return False
        self.reading.robots = count
        return True

    def _located(self, demand: Demand) -> bool:
        return self._follows_thing(demand)

    def _all_round(self, demand: Demand) -> bool:
        return self.reading.relation in ("around", "cage")

    def _all_of(self, demand: Demand) -> bool:
        return self.reading.relation == "inside"

    def _two_things(self, demand: Demand) -> bool:
        return self.reading.relation == "between"

    def _abreast(self, demand: Demand) -> bool:
        beside = self.items[demand.first].symbol in ("beside", "alongside", "next")
        drawn = beside and self.reading.relation == "shape"
        return drawn or self.reading.relation in ("along", "between", "cage")

    def _atop(self, demand: Demand) -> bool:
        return self.reading.relation in ("inside", "centre", "shape")

    def _adverb(self, demand: Demand) -> bool:
        return True

    def _apart(self, demand: Demand) -> bool:
        """Robots of a certified plan never touch."""
        return True

    def _which_of(self, demand: Demand) -> bool:
        """Which of several things, "the upper of the drums"; of one it would be a part."""
        after = self.items[demand.last]
        return SEVERAL.search(self.text[after.start : after.end].lower()) is not None

    def _left_alone(self, demand: Demand) -> bool:
        """Other things, which robots keep off as it is."""
        self.reading.background.append(self._quote(demand.first, demand.last))
        return True

    def _at_each(self, demand: Demand) -> bool:
        if self.reading.relation != "corners" or any(q.whole is None for q in demand.numbers):
            return False
        self.corners += [q.whole for q in demand.numbers if q.whole and q.whole > 1]
        self.reading.one_a_corner = not self.corners
        return True

    def _one_each(self, demand: Demand) -> bool:
        one = self.reading.relation == "corners" and all(q.least == 1 for q in demand.numbers)
        self.reading.one_a_corner |= one
        return one

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
        """Whether words say which thing, "the van on the left"; they belong to it then."""
        at = demand.first - 1
        if at >= 0 and self.items[at].symbol == ",":
            at -= 1
        if at < 0 or self.items[at].symbol != "<t>":
            return False
        self.reaches[at] = demand.last
        return True

    def _spacing(self, demand: Demand) -> bool:
        return self._set("spacing", demand.value)

    def _fit(self, demand: Demand) -> bool:
        return self._set("fit", demand.value)

    def _closure(self, demand: Demand) -> bool:
        return self.reading.relation == "cage" and self._set("closure", demand.value)

    def _layout(self, demand: Demand) -> bool:
        return self.reading.relation == "between" and self._set("layout", demand.value)

    def _quote(self, first: int, last: int) -> str:
        return " ".join(self.text[self.items[first].start : self.items[last - 1].end].split())
