"""The contract for what was read, or the question that has to be asked first."""

from dataclasses import replace
from typing import Any

from ...tools.formation.contract import MAX_ROBOTS
from ..first_message import Task
from .counting import how_far_apart
from .drawn_forms import BESIDE, ENCLOSING, SIDES
from .options import numbered
from .reading import Reading, unscaled

EXAMPLES = "around it, at its corners, along its left side, inside it, between two things, or caged"
LEAST_CAGE = 3
LIKELY_PLACE = 0.3
"""Least probability of another arrangement at which it says where a form is drawn."""
NAMES = {
    "around": "around it",
    "cage": "in a closed ring around it",
    "inside": "inside it, spread evenly",
    "along": "in a row along it",
    "corners": "at its corners",
    "between": "between the two",
    "centre": "at its centre",
    "shape": "in a form drawn by it",
    "at": "at a point",
}
"""Names of arrangements in questions."""


def question_of(task: Task, reading: Reading, robots: int | None) -> str | None:
    """Return what to ask before any thing is looked for; None where all is settled."""
    return (
        _foreign(reading)
        or _stopped(reading)
        or _not_understood(reading, robots)
        or _unsettled(reading)
        or how_far_apart(reading)
        or _how_many(reading, robots)
        or (None if task.robots else _too_few(reading, robots))
        or which_things(task, reading)
    )


def options_of(task: Task, reading: Reading, question: str) -> tuple[str, ...]:
    """Return the alternatives that a question of `question_of` names, in its order."""
    if question == which_things(task, reading):
        ids = tuple(_pointed(task))
        return ids if len(ids) > 1 else ()
    return _arrangements(reading) if question == _unsettled(reading) else ()


def would_do(task: Task, reading: Reading, robots: int) -> bool:
    """Return whether all but some unread words is settled, so that a contract can be shown."""
    settled = not (reading.stops or reading.unscaled or _unsettled(reading))
    settled = settled and _too_few(reading, robots) is None
    settled = settled and not (reading.named or which_things(task, reading))
    return settled and bool(reading.unread)


def things_needed(reading: Reading) -> int:
    """Return how many things the arrangement is about."""
    return 2 if reading.relation == "between" else 1


def contract_of(
    reading: Reading, robots: int, targets: list[str], others: list[str], attempt: int = 0
) -> dict[str, Any]:
    """Return the contract as arguments of propose_formation.

    Args:
        reading: of the instruction, with nothing left to ask.
        robots: total number.
        targets: ids of what the arrangement is about.
        others: ids of `reading.named`: what to stay clear of, then what a row faces or aims at.
        attempt: how many places beside the target had no room for a form.
    """
    fields = {"spacing": "even", "fit": "normal"} | reading.group
    basics = {"targets": targets, **fields}
    looked_at = [*(["facing"] if reading.faced else []), *reading.aims]
    others, ids = others[: len(others) - len(looked_at)], others[len(others) - len(looked_at) :]
    basics |= dict(zip(looked_at, ids, strict=False))
    contract: dict[str, Any] = {"groups": _groups(reading, robots, basics, attempt)}
    if others:
        contract["keep_out"] = others
        if reading.keep_out_clearance:
            contract["keep_out_clearance"] = reading.keep_out_clearance
    if reading.robot_radius is not None:
        contract["robot_radius"] = reading.robot_radius
    return contract


def _groups(
    reading: Reading, robots: int, basics: dict[str, Any], attempt: int
) -> list[dict[str, Any]]:
    relation = reading.relation
    if reading.further:
        aside = sum(count for _, count in reading.further)
        whole = reading.one_a_corner and reading.robots is not None
        main = replace(reading, further=[])
        return [
            *_groups(main, robots - aside if whole else robots, basics, attempt),
            *(_group_aside(side, count, basics["targets"]) for side, count in reading.further),
        ]
    if reading.shares:
        counts = [count or robots // 2 for _, count in reading.shares]
        if sum(counts) != robots and len(counts) == 2:
            counts = [robots - robots // 2, robots // 2]
        sides = [side for side, _ in reading.shares]
        off = {side: {"clearance": [*px]} for side, px in reading.distances.items()}
        return [
            basics | {"relation": "along", "side": s, "robots": n} | off.get(s, {})
            for s, n in zip(sides, counts, strict=True)
        ]
    if reading.rings == 2:
        outer = basics | {"fit": "wide"}
        if "clearance" in basics:
            outer["clearance"] = [2 * d for d in basics["clearance"]]
        less = robots * 2 // 5 or 1
        pair = zip((basics, outer), reading.ring_counts or (less, robots - less), strict=True)
        return [_related(reading, g | {"robots": n}) for g, n in pair]
    if relation == "shape":
        drawn = _drawn(reading, basics, attempt)
        return [basics | {"relation": "shape", "robots": robots} | drawn]
    return [_related(reading, basics | {"robots": robots})]


def _group_aside(side: str, robots: int, targets: list[str]) -> dict[str, Any]:
    place = {"relation": "centre"} if side == "centre" else {"relation": "along", "side": side}
    return place | {"targets": targets, "robots": robots}


def _related(reading: Reading, basics: dict[str, Any]) -> dict[str, Any]:
    group = basics | {"relation": reading.relation}
    if reading.relation == "along" and not {"side", "facing"} & set(group):
        group["side"] = "long"
    return group


def _drawn(reading: Reading, basics: dict[str, Any], attempt: int) -> dict[str, Any]:
    """Return a form's shape with its place by the target; pops side and opens from `basics`."""
    assert reading.form is not None
    shape = reading.form.shape | {"where": place_of(reading, attempt)}
    if "opens" in basics:
        shape["opens"] = basics.pop("opens")
    basics.pop("side", None)
    return {"shape": shape}


def place_of(reading: Reading, attempt: int) -> str | None:
    """Return where by the target a form is drawn; None where the words do not settle it."""
    assert reading.form is not None
    side = reading.group.get("side")
    if side is not None:
        return SIDES.get(side)
    other = {m: p for m, p in reading.meanings if m in ("around", "inside", "along")}
    likely = max(other, key=lambda m: other[m])
    place = reading.place or (likely if other[likely] >= LIKELY_PLACE else "")
    if place == "around" and reading.form.shape["kind"] in ENCLOSING:
        return "around"
    if place == "inside":
        return "inside"
    return BESIDE[attempt] if place == "along" and attempt < len(BESIDE) else None


def _foreign(reading: Reading) -> str | None:
    if not reading.language:
        return None
    return (
        f"That seems to be {reading.language}; the offline planner reads English alone. Say it in "
        "English, or have a language model decide."
    )


def _stopped(reading: Reading) -> str | None:
    if not reading.stops:
        return None
    kind, words = reading.stops[0]
    return (
        f'The words "{words}" are {kind}: the offline rules place robots now, once, or not at all. '
        "Say where they should stand, without it."
    )


def _not_understood(reading: Reading, robots: int | None) -> str | None:
    if reading.unscaled:
        return unscaled(reading.unscaled[0])
    if not reading.unread:
        return None
    quoted = " and ".join(f'"{words}"' for words in reading.unread)
    return (
        f"I would put {robots or 'the'} robots {NAMES.get(reading.relation, 'somewhere by it')}; "
        f"I do not know what to do with {quoted}. Say it another way, or leave it out."
    )


def _unsettled(reading: Reading) -> str | None:
    relation = reading.relation
    if relation == "ask" or (relation == "several" and not reading.shares):
        return (
            "The offline rules read no single arrangement in that. Say one arrangement of all the "
            f"robots, for example {EXAMPLES}."
        )
    if not reading.sure:
        return numbered("Which arrangement is meant?", _arrangements(reading))
    if relation == "shape" and reading.form is None:
        return "Which form should the robots draw? For example a V, an arc, a star or the letter A."
    if relation == "shape" and reading.form and place_of(reading, 0) is None:
        around = ", around" if reading.form.shape["kind"] in ENCLOSING else ""
        return (
            f"Where are the robots to draw {reading.form.wording}? Inside a thing{around}, or "
            "left, right, above or below."
        )
    return "The offline rules place two rings or rows at most." if reading.rings > 2 else None


def _arrangements(reading: Reading) -> tuple[str, ...]:
    """Return the likeliest arrangements of words that settle none."""
    likely = [NAMES[m] for m, _ in reading.meanings if m in NAMES][:2]
    return () if reading.sure else tuple(likely)


def _how_many(reading: Reading, robots: int | None) -> str | None:
    if robots is None and reading.odd_count:
        return f"How many robots? {reading.odd_count!r} names no whole number above 0."
    if robots is not None and robots > MAX_ROBOTS:
        return f"How many robots? {robots:,} are more than the {MAX_ROBOTS:,} that can be placed."
    form = reading.form
    if form and form.robots is not None and robots not in (None, form.robots):
        return (
            f"{form.wording} takes {form.robots} robots, {robots} were named. Which?".capitalize()
        )
    if robots:
        return None
    open_count = {"around": "needed", "cage": "needed", "inside": "fit"}.get(reading.relation)
    return "How many robots? Say a number" + (
        f", or as many as {open_count}." if open_count else "."
    )


def _too_few(reading: Reading, robots: int | None) -> str | None:
    if reading.relation != "cage" or robots is None or robots >= LEAST_CAGE:
        return None
    return f"A closed ring takes {LEAST_CAGE} robots or more, not {robots}. How many robots?"


def which_things(task: Task, reading: Reading) -> str | None:
    """Return what to ask if the number of things pointed at does not fit; None if it does."""
    pointed = _pointed(task)
    needed = things_needed(reading)
    if reading.named and len(pointed) == needed + len(reading.named):
        return None
    if len(pointed) == 1 and needed == 2:
        return "Which two things? Point at both."
    if len(pointed) > needed:
        named = ", ".join(pointed)
        return (
            f"{len(pointed)} things were pointed at ({named}), the arrangement is about {needed}. "
            "Which?"
        )
    return None


def _pointed(task: Task) -> list[str]:
    return list(dict.fromkeys([*task.targets, *(p["id"] for p in task.pointed)]))
