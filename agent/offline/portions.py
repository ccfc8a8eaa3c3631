"""Demands that divide a team: so many on each side, in rows and rings, or beside the rest."""

from collections.abc import Collection, Sequence
from typing import Any

from ...tools.formation.quantities import Quantity
from .demands import Demand, Item
from .drawn_forms import Form
from .reading import Reading

FARTHEST = 100_000.0
"""Upper bound of a clearance that has none, px."""
OPPOSITE = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}
LONG_SIDES = ("long", "longer", "short", "shorter")


class Portions:
    """Rules that carry demands about parts of the team over into a reading."""

    def __init__(
        self, items: Sequence[Item], reading: Reading, metres_per_pixel: float | None
    ) -> None:
        self.items, self.reading, self.scale = items, reading, metres_per_pixel
        self.per_side: Demand | None = None  # a count per side; how many sides is settled later
        self.some_sides: Demand | None = None

    def _set(self, name: str, value: Any) -> bool:
        """Set a field of the group; return False if it has another value already."""
        group = self.reading.group
        if group.get(name, value) != value:
            return False
        group[name] = value
        return True

    def _only(self, sides: list[str]) -> bool:
        self.reading.meanings = [("around", 1.0), *self.reading.meanings]
        return self._set("sides", sides)

    def _robots_are(self, count: int) -> bool:
        if self.reading.robots not in (None, count):
            return False
        self.reading.robots = count
        return True

    def _groups(self, demand: Demand) -> bool:
        sides = dict.fromkeys(demand.sides)
        counts = [q.whole or 0 for q in demand.numbers if not q.is_length]
        if not self._distances(demand):
            return False
        if demand.value == "each" and not any(n > 1 for n in counts):
            counts = [1] * len(sides)
        counts = counts or [0] * len(sides)
        if len(sides) != len(counts) or self.reading.shares or not sides.keys() <= OPPOSITE.keys():
            return False
        self.reading.shares = list(zip(sides, counts, strict=True))
        return not all(counts) or self._robots_are(sum(counts))

    def _distances(self, demand: Demand) -> bool:
        """Read the distances of a team's parts; a single one that comes last is that of all."""
        told: dict[int, Quantity] = {}
        part = -1
        for quantity in demand.numbers:
            if not quantity.is_length:
                part += 1
            elif part in told or part < 0:
                return False
            else:
                told[part] = quantity
        if [*told] == [len(demand.sides) - 1]:
            told = dict.fromkeys(range(len(demand.sides)), told[part])
        return all(self._set_off(demand.sides[k], length) for k, length in told.items())

    def _set_off(self, side: str, length: Quantity, bound: str = "") -> bool:
        """Set the distance of the robots at a side; return False if they have another."""
        px = (length.least, length.most) if not length.is_length else length.px(self.scale)
        if px is None:
            self.reading.unscaled.append(length.wording)
        if px is None or px[0] < 0:
            return False
        least = 0.0 if bound == "most" else px[0]
        distance = (least, FARTHEST if bound == "least" else max(px[1], least + 1))
        return self.reading.distances.setdefault(side, distance) == distance

    def _ones_aside(self, demand: Demand) -> bool:
        """Read the distance of the robots at a side: "the left ones 20 px away"."""
        named = demand.sides[0] in {side for side, _ in self.reading.shares}
        length = demand.quantity
        return named and length is not None and self._set_off(demand.sides[0], length, demand.bound)

    def _each_side(self, demand: Demand) -> bool:
        """Read a count per side: on both, on all four, or on as many as the robot count gives."""
        said = {self.items[k].symbol for k in range(demand.first, demand.last)}
        if self.reading.relation != "along" or self.reading.shares or self.per_side is not None:
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
        """Read a number of sides, which are named there or by the one that is left free."""
        self.reading.meanings = [("around", 1.0), *self.reading.meanings]
        self.some_sides = demand
        return not demand.sides or self._only([*demand.sides])

    def unsettled(self) -> list[Demand]:
        """Return the demands about sides for which nothing settles how many they are, or which."""
        found: list[Demand] = []
        each, some, robots = self.per_side, self.some_sides, self.reading.robots
        if each is not None:
            per = each.quantity.whole if each.quantity else 1
            named = {2: LONG_SIDES, 4: {*OPPOSITE}}.get((robots or 0) // (per or 1))
            if not (per and named and self._on_sides(named, set(), per)):
                found.append(each)
        sides = self.reading.group.get("sides", ())
        if some is not None and len(sides) != some.numbers[0].whole:
            found.append(some)
        return found

    def _rows_of(self, demand: Demand) -> bool:
        """Read "two rows of five": a grid, or beside a thing one row outside the other."""
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
        """Read robots in addition to the arrangement: "and one in the middle"."""
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
        """Read two rings of six, or four in the inner ring and six in the outer one."""
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
