"""How many robots an instruction means where it says no number: needed, fitting, one a corner.

For as many as needed or as fit a few robots are proposed first, which measures the thing; an edit
then settles how many it takes.
"""

import json
import re
from typing import Any

from ..messages import Call, History, Reply, Result
from .choosing import calls_in
from .reading import Reading

FEWEST = 3
"""Number of robots that is proposed first."""
USUAL_CORNERS = 4
LEFT_TO_YOU = re.compile(
    r"\W*(?:(?:just|ok|okay|then|well|i don't know|dunno|no idea)\W+)*"
    r"(?:(?:as many )?as (?:needed|necessary|it takes|you need|required)"
    r"|whatever (?:it takes|is needed|you need|you like|works)|however many[a-z ']*|enough"
    r"|(?:you|your) (?:decide|choose|pick|choice|call|tell me)|(?:it's |it is |that's )?up to you)"
    r"(?: how many)?(?: please)?\W*",
    re.IGNORECASE,
)
"""An answer to how many robots that leaves the number to the tools."""
CLOSING = ("around", "cage")
"""Arrangements that as many as needed close."""
FILLING = ("inside", *CLOSING, "along")
"""Arrangements of which it can be said how many fit."""


def count_left_open(reading: Reading) -> str | None:
    """Return the number that an edit settles: needed, held or fit; None where it is not open."""
    if reading.robots or reading.further or reading.shares or reading.rings > 1:
        return None
    if reading.count == "needed" and reading.relation in CLOSING:
        return "held" if reading.group.get("closure") == "escape-proof" else "needed"
    return "fit" if reading.count == "fit" and reading.relation in FILLING else None


def without_closure(contract: dict[str, Any], count: str | None) -> dict[str, Any]:
    """Return the contract of the first few robots, which are too few to hold anything."""
    if count != "held":
        return contract
    groups = [{k: v for k, v in g.items() if k != "closure"} for g in contract["groups"]]
    return contract | {"groups": groups}


def count_edit(reading: Reading, proposal: Result, plan: dict[str, Any]) -> Reply | None:
    """Return the edit that settles how many robots stand there; None if the number is not open."""
    count = count_left_open(reading)
    if count is None or proposal.name != "propose_formation":
        return None
    edits = {"plan_id": plan["plan_id"], "edits": [{"kind": "count", "robots": count}]}
    return Reply(calls=(Call(id="call", name="edit_formation", arguments=edits),))


def refused(edit: Result) -> Reply:
    """Return the end of a turn in which the number could not be settled."""
    reason = {"reason": f"{edit.text} Say a number of robots."}
    return Reply(calls=(Call(id="call", name="report_impossible", arguments=reason),))


def how_far_apart(reading: Reading) -> str | None:
    """Return what to ask where as many as fit are meant, however far apart; else None."""
    apart = {"min_spacing", "pitch"} & set(reading.group) or reading.robot_radius
    if count_left_open(reading) != "fit" or apart:
        return None
    return "How far apart are the robots to be? Say a distance or a number of robots."


def counts_corners(reading: Reading) -> bool:
    """Return whether there are as many robots as the thing has corners."""
    return reading.relation == "corners" and reading.one_a_corner and reading.robots is None


def corner_count(history: History) -> int | None:
    """Return the corners of the thing's outline, which a first proposal measures; before that 4."""
    measured = [m for m in history if isinstance(m, Result) and m.name == "propose_formation"]
    if not measured or measured[-1].error:
        return USUAL_CORNERS
    target = json.loads(measured[-1].text)["targets"][0]
    return int(target["corners"]) or None


def counted(last: Result, history: History) -> dict[str, Any] | None:
    """Return the plan of which an edit settled the number, or None where it was refused."""
    if last.error:
        return None
    proposed = next(c for c in reversed(calls_in(history)) if c.name == "propose_formation")
    first = next(m for m in history if isinstance(m, Result) and m.call_id == proposed.id)
    return json.loads(first.text) | json.loads(last.text)
