"""Edits that follow from the last ones: more of it, less, the other way, not so far."""

import re
from collections.abc import Sequence
from typing import Any

from .followup_edits import (
    FACTOR,
    OPPOSITE,
    TURN,
    Effect,
    Effects,
    Utterance,
    ask,
    factor_of,
    much_of,
    offset,
    rounded,
)
from .followup_frames import Slots
from .followup_moves import WAY, shift

RELATIVE = (
    *("out", "in", "rotate", "shift", "scale", "spacing", "place", "add", "remove"),
    *("mirror", "swap"),
)
"""Kinds of edits that can be repeated, each on top of the one before."""
FURTHER = re.compile(r"\b(?:further|farther)(?: please)?\W*$", re.IGNORECASE)
"""Without a direction, this goes on in that of the last move."""


def _latest(said: Utterance, kinds: Sequence[str] = RELATIVE) -> list[Effect]:
    """Return the last edit of one of these kinds; if robots moved one by one, all those edits."""
    edits = [dict(e) for e in said.last]
    while edits and edits[-1]["kind"] not in kinds:
        edits.pop()
    alike = [k for k, e in enumerate(edits) if e["kind"] != edits[-1]["kind"]]
    return edits[alike[-1] + 1 if alike else 0 :] if edits and "robot" in edits[-1] else edits[-1:]


def further_on(slots: Slots, said: Utterance) -> Effects:
    """Read "a bit further" after a robot was moved or all were turned: on in that direction."""
    kinds = {e["kind"] for e in _latest(said)}
    slots.has("radial", "again")
    if not kinds or kinds - {"place", "rotate"}:
        return None
    return more(slots, said) if FURTHER.search(said.words) else None


def again(slots: Slots, said: Utterance) -> Effects:
    """Repeat the last change, or redo what was just taken back."""
    if said.standing.redo and not said.before and not said.last:
        return [{"kind": "undo", "steps": -1}]
    edits = [e for e in said.last if e["kind"] in RELATIVE and "to" not in e]
    return edits or None


def more(slots: Slots, said: Utterance) -> Effects:
    """Do more of the last change; without an amount, as much again."""
    last = _latest(said, (*RELATIVE, "opening", "distance"))
    if not last:
        return ask("More of what?", "a bit further out", "a bit closer", "one more robot")
    amounts = [_again(edit, slots, said) for edit in last]
    found = [amount for amount in amounts if amount is not None]
    return found if len(found) == len(last) else None


def more_of(slots: Slots, said: Utterance) -> Effects:
    """Do more of the last change for some of the robots it was about."""
    named = {r for robots in slots["robots"] for r in robots}
    slots.has("make", "move")
    placed = [e for e in _latest(said) if e.get("robot") in named]
    amounts = [_again(edit, slots, said) for edit in placed]
    found = [amount for amount in amounts if amount is not None]
    return found if len(found) == len(named) else None


def _again(last: Effect, slots: Slots, said: Utterance) -> Effect | None:
    kind, size = last["kind"], min(said.standing.size)
    much = much_of(slots)
    length = float(slots["px"][0]) if "px" in slots else None
    if kind in ("out", "in"):
        if length is None and not much and "share" not in slots:
            return last
        return (offset(Slots({**slots, "radial": [kind]}), said) or [None])[0]
    if kind == "distance":
        return None if length is None else {"kind": "out", "px": length}
    if kind == "rotate":
        sign = 1 if last["degrees"] > 0 else -1
        turned = slots.get(
            "angle", slots.get("num", [TURN[much] if much else abs(last["degrees"])])
        )[0]
        return {"kind": "rotate", "degrees": sign * float(turned)}
    if kind in ("shift", "place") and ("to" not in last and "target" not in last):
        way = length if length is not None else round(WAY[much] * size) if much else None
        return _further(last, way)
    if kind in ("scale", "spacing") and "factor" in last:
        factor = FACTOR[much] if much else None
        up = last["factor"] > 1
        return {
            "kind": kind,
            "factor": last["factor"] if factor is None else rounded(factor if up else 1 / factor),
        }
    if kind == "opening":
        return {"kind": kind, "factor": factor_of(slots)} if length is None else None
    number = slots.get("num", [None])[0]
    if kind in ("add", "remove") and "n" in last and length is None:
        return last if number is None else {"kind": kind, "n": int(number)}
    return None


def _further(last: Effect, way: float | None) -> Effect | None:
    """Return a move in the direction of the last one, as far again or `way` px far."""
    if way is None:
        return last
    by: Any = last.get("by")
    if isinstance(by, dict):
        return last | {"by": {name: way for name in ("out", "in") if name in by}}
    dx, dy = (last["dx"], last["dy"]) if last["kind"] == "shift" else last["by"]
    length = max(abs(dx), abs(dy))
    if not length:
        return None
    x, y = rounded(dx / length * way), rounded(dy / length * way)
    return last | ({"dx": x, "dy": y} if last["kind"] == "shift" else {"by": [x, y]})


def less_by(slots: Slots, said: Utterance) -> Effects:
    """Reduce the distance by px; None if the last change was of something else."""
    distances = ("distance", "out", "in")
    if said.last and said.last[-1]["kind"] not in distances:
        return None
    return [{"kind": "in", "px": float(slots["px"][0])}]


def less(slots: Slots, said: Utterance) -> Effects:
    """Take back half of the last change, whatever amount is given."""
    slots.has("much", "ratio", "back")
    last = _latest(said, (*RELATIVE, "opening"))
    halved = [half for edit in last if (half := _scaled(edit, -0.5)) is not None]
    if not halved or len(halved) < len(last):
        return ask("Less of what?", "a bit closer", "take one robot away")
    return halved


def _scaled(edit: Effect, share: float) -> Effect | None:
    """Return an edit that does a share of another; a negative share takes so much of it back."""
    kind = edit["kind"]
    if kind in ("out", "in", "scale", "spacing", "opening"):
        back = {"out": "in", "in": "out"}.get(kind, kind)
        if "factor" not in edit:
            return (
                {"kind": back, "px": rounded(edit["px"] * abs(share))}
                if "px" in edit and kind in ("out", "in")
                else None
            )
        factor = edit["factor"]
        if kind == "in":
            kept = 1 / factor
            return {"kind": back, "factor": rounded((kept + (1 - kept) * -share) / kept)}
        left = 1 + (factor - 1) * (1 + share)
        return {"kind": back, "factor": rounded(factor / left if kind == "out" else left / factor)}
    names = {"rotate": ("degrees",), "shift": ("dx", "dy")}.get(kind)
    if names:
        return {"kind": kind, **{n: rounded(edit[n] * share) for n in names}}
    if kind == "place" and "by" in edit:
        by: Any = edit["by"]
        if isinstance(by, dict):
            given: dict[str, float] = edit["by"]
            ways = {k: v for k, v in given.items() if k in ("out", "in")}
            back = {"out": "in", "in": "out"}
            return edit | {"by": {back[k]: rounded(v * -share) for k, v in ways.items()}}
        return edit | {"by": [rounded(v * share) for v in by]}
    if kind in ("add", "remove") and edit.get("n", 0) > 1:
        return {"kind": {"add": "remove", "remove": "add"}[kind], "n": edit["n"] // 2}
    return None


def otherway(slots: Slots, said: Utterance) -> Effects:
    """Make the last change the other way; with "a bit" or the like, take half of it back."""
    turning = (*RELATIVE, "opening", "sides", "heading")
    last = _latest(said, turning)
    if not last:
        return ask('"The other way" of what?', "turn it left", "turn it right")
    if "much" in slots:
        return less(slots, said)
    other = [turned for edit in last if (turned := _turned(edit)) is not None]
    if len(other) < len(last):
        return None
    return corrected(last, other) if last[-1]["kind"] in RELATIVE else other


def corrected(last: Sequence[Effect], edits: Sequence[Effect]) -> list[Effect]:
    """Return edits that replace the last ones: those are taken back first, within one change."""
    back = [inverse(e) for e in reversed(last)]
    found = [e for e in back if e is not None]
    if len(found) < len(back):
        return [{"kind": "undo", "steps": 1}, *edits]
    if len(found) == len(edits) and (len(edits) == 1 or all("robot" in e for e in edits)):
        return [
            e for first, then in zip(found[::-1], edits, strict=True) for e in _merged(first, then)
        ]
    return [*found, *edits]


def _merged(first: Effect, then: Effect) -> list[Effect]:
    """Return two edits as one if they are of one kind and of the same robot, else both."""
    if first["kind"] != then["kind"] or first.get("robot") != then.get("robot"):
        return [first, then]
    if "factor" in first and "factor" in then:
        return [first | {"factor": rounded(first["factor"] * then["factor"])}]
    names = {"rotate": ("degrees",), "shift": ("dx", "dy")}.get(first["kind"], ("none",))
    if names[0] in then:
        return [then | {n: rounded(first[n] + then[n]) for n in names}]
    if isinstance(first.get("by"), list) and isinstance(then.get("by"), list):
        (x, y), (u, v) = first["by"], then["by"]
        return [then | {"by": [rounded(x + u), rounded(y + v)]}]
    return [first, then]


def inverse(edit: Effect) -> Effect | None:
    """Return the edit that takes another back; None where there is none."""
    if edit["kind"] in ("mirror", "swap"):
        return edit
    if edit["kind"] in ("add", "remove"):
        other = {"add": "remove", "remove": "add"}[edit["kind"]]
        return edit | {"kind": other} if "n" in edit and "to" not in edit else None
    return _scaled(edit, -1.0) if edit["kind"] in RELATIVE else None


def _turned(edit: Effect) -> Effect | None:
    """Return the edit in the opposite sense; None where there is none."""
    kind = edit["kind"]
    if kind in ("out", "in"):
        return edit | {"kind": {"out": "in", "in": "out"}[kind]}
    if kind == "mirror":
        return edit | {
            "axis": {"left-right": "top-bottom", "top-bottom": "left-right"}[edit["axis"]]
        }
    if kind in ("scale", "spacing") and "factor" in edit:
        return edit | {"factor": rounded(1 / edit["factor"])}
    if kind == "opening" and edit.get("towards") in OPPOSITE:
        return {"kind": kind, "towards": OPPOSITE[edit["towards"]]}
    if kind == "sides" and len(edit.get("only", ())) == 1 and edit["only"][0] in OPPOSITE:
        return edit | {"only": [OPPOSITE[edit["only"][0]]]}
    if kind == "heading" and edit["to"] in ("towards", "away"):
        return edit | {"to": {"towards": "away", "away": "towards"}[edit["to"]]}
    return _scaled(edit, -1.0) if kind in ("rotate", "shift", "place") else None


def toofar(slots: Slots, said: Utterance) -> Effects:
    """Take half of the last change back if it led to "too far" or "too close", else move a bit."""
    if "dir" in slots:
        back = {"left": "right", "right": "left", "up": "down", "down": "up"}[slots["dir"][0]]
        return shift(Slots({"dir": [back], "much": ["bit"]}), said)
    last = next(iter(_latest(said)), None)
    _, denied, side = str(slots["toofar"][0]).rpartition("not ")
    way = {"far": "out", "near": "in"}[side]
    if last is not None and (
        last["kind"] == way
        or (way == "out" and not denied and last["kind"] in ("rotate", "shift", "place"))
    ):
        return less(slots, said)
    factor = rounded(factor_of(slots)) if denied else FACTOR["bit"]
    return [{"kind": {"out": "in", "in": "out"}[way], "factor": factor}]
