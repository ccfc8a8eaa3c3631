"""Rules that carry demands of an instruction over into fields of the contract."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from .counting import count_left_open
from .demands import Demand, Item, is_part
from .drawn_forms import Form
from .lexicon import fillers
from .other_things import OtherThings
from .portions import FARTHEST, OPPOSITE
from .reading import Reading
from .tagging import word_classes

OPENS = {side: side for side in ("left", "right", "up", "down")} | {"top": "up", "bottom": "down"}
COUNTING = frozenset(
    ("of", "in", "with", "using", "by", "use", "total", "altogether", "strong", "number")
)
"""Words beside a number of robots that do not describe the robots."""
DEGREES = {"right": 0, "bottom": 90, "down": 90, "left": 180, "top": 270, "up": 270}
LEAST_BARE = 5
"""Least number without a unit that may be a length, px."""
LENGTHS = ("clearance", "pitch", "min_spacing", "max_gap", "radius", "diameter", "opening")


class Fields(OtherThings):
    """Carries demands over into a reading."""

    def __init__(
        self, text: str, items: Sequence[Item], reading: Reading, metres_per_pixel: float | None
    ) -> None:
        super().__init__(text, items, reading, metres_per_pixel)
        self.corners: list[int] = []  # how many corners the words name
        self.count_at = -1  # first item of the words that leave the number of robots open
        self.reaches: dict[int, int] = {}  # past-the-last item of phrases for things that go on

    def apply(self, demand: Demand) -> bool:
        """Carry a demand over into the reading; return False if that is not possible."""
        if demand.sets in LENGTHS or demand.sets in ("robot_radius", "robot_diameter"):
            return self._length(demand)
        rule = getattr(self, f"_{demand.sets}", None)
        return rule is not None and bool(rule(demand))

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
        other = self._other(demand) if len(among) > 1 else None
        if other is not None and not is_part(other):
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

    def _keep_off_by(self, demand: Demand) -> bool:
        """Read a distance to keep from another thing: "stay 50 px clear of the trucks"."""
        other = self._other(demand) or self._marked(demand)
        if other is None or is_part(other) or not self._refers_elsewhere(demand):
            return self._length(replace(demand, sets="clearance"))
        px = self._px_of(demand)
        known = self.reading.keep_out_clearance
        if not px or demand.bound == "most" or known not in (0.0, px):
            return False
        self.reading.keep_out_clearance = px
        self.reading.others += [other] if other not in self.reading.others else []
        return True

    def _px_of(self, demand: Demand) -> float | None:
        """Return a demand's least length, px; None if it has none, or no scale to measure it by."""
        quantity = demand.quantity
        if quantity is None or not quantity.is_length:
            return None if quantity is None else quantity.least
        px = quantity.px(self.scale)
        if px is None:
            self.reading.unscaled.append(quantity.wording)
        return px and px[0]

    def _length_alone(self, demand: Demand) -> bool:
        """Read a length that ends the words about a ring as its distance from the thing."""
        rings = self.reading.relation in ("around", "cage", "corners")
        return rings and self._length(replace(demand, sets="clearance"))

    def _every(self, demand: Demand) -> bool:
        """Read one robot per length as the pitch: "a robot every 20 px"."""
        if any(q.kind == "number" and q.whole != 1 for q in demand.numbers):
            return False
        return self._length(replace(demand, sets="pitch"))

    def _spaced(self, demand: Demand, low: float, high: float) -> bool:
        name = demand.sets
        if name == "pitch" and demand.bound:
            name = "min_spacing" if demand.bound == "least" else "max_gap"
        if name == "pitch" and self.reading.relation == "inside" and self.reading.count == "fit":
            name = "min_spacing"
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

    def _aimed_opening(self, demand: Demand) -> bool:
        """Read an opening towards another thing: "a gap towards the gate", "the door side free"."""
        phrase = self._other(demand) or self._noun_in(demand)
        low = demand.quantity.px(self.scale) if demand.quantity else (0.0, 0.0)
        return (
            phrase is not None
            and low is not None
            and self._opening(demand, low[0])
            and self._aim("opening_towards", phrase)
        )

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
        if self.count_at > demand.first:  # "5 robots, as many as needed": which?
            return False
        return self._robots_are(number.whole)

    def _count(self, demand: Demand) -> bool:
        """Leave the number of robots to the tools: "as many as needed"."""
        open_still = self.reading.robots is None and self.reading.count in ("", demand.value)
        self.reading.count, self.count_at = demand.value, demand.first
        return open_still and count_left_open(self.reading) is not None

    def _note_kind(self, demand: Demand) -> None:
        """Note words for the kind of robot as background: "24 small yellow robots"."""
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

    def _located(self, demand: Demand) -> bool:
        return self._follows_thing(demand)

    def _all_round(self, demand: Demand) -> bool:
        return self.reading.relation in ("around", "cage")

    def _ring(self, demand: Demand) -> bool:
        return self._all_round(demand)

    def _rest_closed(self, demand: Demand) -> bool:
        return "opening" in self.reading.group or "opening_towards" in self.reading.group

    def _purpose(self, demand: Demand) -> bool:
        """Note why as background, where the words say how as well."""
        prevents = any(self.items[k].symbol == "from" for k in range(demand.first, demand.last))
        if prevents and self.reading.relation == "cage":
            return True  # that is what a cage is for
        said = self.reading.relation in ("between", "along", "around", "corners")
        return (said or not prevents) and self._left_alone(demand)

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
        """Accept that robots must not touch: those of a certified plan never do."""
        return True

    def _at_each(self, demand: Demand) -> bool:
        if self.reading.relation != "corners" or any(q.whole is None for q in demand.numbers):
            return False
        first, *after = self.items[demand.first : demand.last]
        each = not {"each", "every", "per", "a", "an"}.isdisjoint(i.symbol for i in after)
        if each and first.quantity is not None and first.quantity.whole != 1:
            return False  # several at each of them
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
        """Add words that say which thing to the phrase for it: "the van on the left"."""
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
