"""Words for what follows from other things: the gap between two, a half or an end of one."""

import re
from dataclasses import replace
from typing import Any

from ..first_message import Task
from ..messages import History
from .accounting import read_instruction
from .choosing import Step, calls_in, find
from .drafting import contract_of, question_of
from .references import described

UNTIL = r"(?=\s*(?:[,;.!]|\b(?:with|by|using|at least|please|facing)\b|$))"
GAP = re.compile(
    r"\bthe (?:gap|(?:free |empty |open )?(?:space|area|place)) between "
    rf"(?P<one>[^,;.]+?) and (?P<other>[^,;.]+?){UNTIL}",
    re.IGNORECASE,
)
PART = re.compile(
    r"\bthe (?P<side>left|right|top|bottom|upper|lower)(?:[- ]hand)? (?P<what>half|end) of "
    rf"(?P<one>[^,;.]+?){UNTIL}",
    re.IGNORECASE,
)
SIDES = {"upper": "top", "lower": "bottom"}
WITHIN = ("inside", "centre")
"""Arrangements on or in a thing; around a part, robots would stand on the rest of it."""


def about_derived(task: Task, robots: int | None, history: History) -> Step | None:
    """Return the step for a gap or a part that the words name; None where they name none.

    Args:
        robots: how many, if that was given apart from the words.
    """
    said = GAP.search(task.instruction) or PART.search(task.instruction)
    if said is None or task.standing or task.pointed or task.targets:
        return None
    text = f"{task.instruction[: said.start()]}it{task.instruction[said.end() :]}"
    reading = read_instruction(text, task.metres_per_pixel)
    robots = robots or reading.robots
    if reading.relation not in WITHIN or robots is None:
        return None
    known = ({"id": "t1"},)
    alone = replace(task, instruction=text, pointed=known)
    if question := question_of(alone, reading, robots):
        return Step("ask_user", {"question": question})
    if any(call.name == "derive_target" for call in calls_in(history)):
        contract = contract_of(reading, robots, ["t1"], [])
        unit = {} if task.metres_per_pixel is None else {"unit": "px"}
        return Step("propose_formation", {"contract": contract | unit, "targets": []})
    return _derived(said, history)


def _derived(said: re.Match[str], history: History) -> Step:
    """Return the call that makes the target, or one that helps to find what it follows from."""
    groups = said.groupdict()
    phrases = [groups[name] for name in ("one", "other") if groups.get(name)]
    found = find(described(phrases), len(phrases), history)
    if isinstance(found, Step):
        return found
    made: dict[str, Any] = {"id": "t1", "label": said[0].removeprefix("the ")[:60]}
    made["of"] = [f.candidate for f in found]
    if said.re is GAP:
        return Step("derive_target", made | {"kind": "gap"})
    side = groups["side"].lower()
    where = f"{SIDES.get(side, side)} {groups['what'].lower()}"
    return Step("derive_target", made | {"kind": "part", "where": where})
