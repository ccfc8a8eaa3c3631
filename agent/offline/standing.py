"""The state at the beginning of a later turn, as the planner gets it: plan, robots and things."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .drawn_forms import SIDES


@dataclass(frozen=True)
class Standing:
    """The current plan, and what was done to it last.

    Attributes:
        plan: its id.
        contract: of the plan, as JSON; lengths in px.
        robots: ids in the order of positions.
        deployed: whether the robots stand there.
        apart: ids of robots that stand by themselves, each at a point of its own.
        said: words of the turn before, whatever their effect.
        words, edits: the last words that changed the plan, and the changes; none at first.
        things: ids and labels of what was measured.
        past: the plans that undo goes back to, latest first, as arrangements and number of robots.
        steps, redo: how many steps can be undone, including the first plan, and how many redone.
        centre: of each thing, px.
        places: of each robot by its id, px, if the words refer to robots by place; else None.
        pointed: ids of what this turn points at; `place`: the point, if it points at one.
        size: width and height of the picture, px.
        metres_per_pixel: of the picture; None where it has no scale.
    """

    plan: str
    contract: Mapping[str, Any]
    robots: tuple[str, ...]
    deployed: bool = False
    apart: tuple[str, ...] = ()
    words: str = ""
    edits: tuple[Mapping[str, Any], ...] = ()
    things: tuple[tuple[str, str], ...] = ()
    past: tuple[tuple[tuple[str, ...], int], ...] = ()
    steps: int = 0
    redo: int = 0
    centre: Mapping[str, tuple[float, float]] | None = None
    pointed: tuple[str, ...] = ()
    place: tuple[float, float] | None = None
    size: tuple[int, int] = (0, 0)
    metres_per_pixel: float | None = None
    said: str = ""
    places: Mapping[str, tuple[float, float]] | None = None

    @classmethod
    def of(cls, facts: Mapping[str, Any], **told: Any) -> "Standing":
        """Make it from the line `Standing` of a turn's first message, and further fields `told`."""
        last: dict[str, Any] = facts.get("last") or {}
        return cls(
            plan=facts["plan"],
            contract=facts["contract"],
            robots=tuple(facts["robots"]),
            deployed=facts.get("deployed", False),
            apart=tuple(facts.get("apart", ())),
            words=last.get("words", ""),
            edits=tuple(last.get("edits") or ()),
            things=tuple((t["id"], t.get("label", "")) for t in facts.get("things", ())),
            past=tuple((tuple(names), robots) for names, robots in facts.get("past", ())),
            steps=facts.get("undo", 0),
            redo=facts.get("redo", 0),
            centre={
                t["id"]: (t["centre"][0], t["centre"][1])
                for t in facts.get("things", ())
                if "centre" in t
            },
            places=facts.get("places"),
            **told,
        )

    @property
    def groups(self) -> list[dict[str, Any]]:
        """The groups of the contract."""
        return list(self.contract["groups"])

    @property
    def relation(self) -> str:
        """The arrangement of the first group."""
        return str(self.groups[0]["relation"])

    @property
    def beside(self) -> str | None:
        """Where by its target the first group's form or row is: "above"; None if all round."""
        group = self.groups[0]
        shape: dict[str, Any] = group.get("shape") or {}
        where: str | None = shape.get("where")
        return where or SIDES.get(str(group.get("side")))

    def place_of(self, form: str) -> str | None:
        """Return where another form is to be drawn: beside the target as now, or around it.

        Only a closed form can stand instead of a ring.
        """
        ring = self.relation in ("around", "cage", "corners") and form in ("polygon", "star")
        return self.beside or ("around" if ring else None)

    @property
    def targets(self) -> list[str]:
        """Ids of what the groups are about, in order, without repeats."""
        return list(dict.fromkeys(t for group in self.groups for t in group.get("targets", ())))

    @property
    def stood_about(self) -> str:
        """Words for what the groups are about."""
        return " ".join(f"{name} {label}" for name, label in self.things if name in self.targets)

    @property
    def changes(self) -> int:
        """How many changes can be taken back with a plan still left."""
        return max(self.steps - 1, 0)

    def others(self) -> list[str]:
        """Return known things that no group is about; those pointed at in this turn come first."""
        known = [*self.pointed, *(name for name, _ in self.things)]
        return [t for t in dict.fromkeys(known) if t not in self.targets]
