"""From a frame to edits of which sides robots stand on, and of gaps in their ring."""

import re

from .followup_edits import (
    OPPOSITE,
    RINGS,
    SIDE_OF,
    SIDES,
    Effect,
    Effects,
    Said,
    ask,
    bare_length,
    factor_of,
    rounded,
    where,
)
from .followup_frames import Slots

PUSHING = re.compile(r"\b(?:move|shift|nudge|push|pull|slide|drag)\b", re.IGNORECASE)
"""With these "all right" is a way to go, no side to be on."""


def sides(slots: Slots, said: Said) -> Effects:
    """Only on one side, or one side left free."""
    named = [SIDE_OF.get(s, s) for s in (*slots.get("flank", ()), *slots.get("side", ()))]
    without = "neg" in slots or "free" in slots
    if "flank" not in slots and PUSHING.search(said.words):
        return None
    if not named or len(set(named)) < len(named) or ("only" in slots and without):
        return None
    if said.standing.relation in RINGS and not {"long", "short"} & {*named}:
        return [{"kind": "sides", "without" if without else "only": named}]
    if len(named) > 1 or " half" in str(named[0]) or without:
        return None
    return [{"kind": "side", "side": named[0]}]


def opposite(slots: Slots, said: Said) -> Effects:
    """The side opposite of the one that robots are on, or of the one that is open."""
    group = said.standing.groups[0]
    opening = group.get("opening_towards")
    if opening in OPPOSITE and (said.standing.relation in RINGS):
        return [{"kind": "opening", "towards": OPPOSITE[opening]}]
    if "gap" in slots:
        return None
    if group.get("side") in ("left", "right", "top", "bottom"):
        return [{"kind": "side", "side": OPPOSITE[group["side"]]}]
    parts = [str(p).partition(" ") for p in group.get("sides") or ()]
    if len(parts) != 1:
        return ask(
            f'Opposite of what, in "{said.words}"?',
            *(f"only on the {s} side" for s in ("left", "right", "top", "bottom")),
        )
    side, space, half = parts[0]
    return [{"kind": "sides", "only": [f"{OPPOSITE[side]}{space}{half}"]}]


def not_that_side(slots: Slots, said: Said) -> Effects:
    """The side last named left free."""
    last = next((e for e in reversed(said.last) if "only" in e), None)
    named = list(last["only"]) if last else list(said.standing.groups[0].get("sides") or ())
    if not named:
        return ask(
            "Which side is to be free?",
            *(f"leave the {s} side free" for s in ("left", "right", "top", "bottom")),
        )
    return [{"kind": "sides", "without": named}]


def gap(slots: Slots, said: Said) -> Effects:
    """An opening towards something, wider or narrower, or on the other side."""
    opening: Effect = {"kind": "opening"}
    slots.has("gap")
    if "opposite" in slots or "otherway" in slots:
        return opposite(slots, said)
    if "there" in slots or "other" in slots or "thing" in slots:
        to = where(slots, said, "leave a gap towards {}")
        if isinstance(to, list):
            return to
        opening["towards"] = to
    if "angle" in slots:
        opening["towards"] = float(slots["angle"][0])
    facing = [SIDE_OF[d] for d in (*slots.get("dir", ()), *slots.get("side", ())) if d in SIDE_OF]
    if len(set(facing)) > 1 or (facing and "towards" in opening):
        return None
    if facing:
        opening["towards"] = facing[0]
    stands = said.standing.groups[0].get("opening") is not None
    ways = {"bigger": "wider", "smaller": "narrower", "up": "wider", "down": "narrower"}
    change = ways.get([*slots.get("scale", ()), *slots.get("grow", ()), ""][0])
    change = slots.get("wide", [change])[0] if "wide" in slots else change
    change = "wider" if "more" in slots and not change and not facing else change
    change = "narrower" if "less" in slots else change
    if change in ("wider", "narrower"):
        if not stands:
            return ask(
                "No gap is left in the ring yet. Where should one be?",
                *(f"leave a gap to the {s}" for s in ("left", "right", "top", "bottom")),
            )
        sign = 1 if change == "wider" else -1
        width = said.standing.groups[0]["opening"] + sign * slots["px"][0] if "px" in slots else 0.0
        return [
            opening
            | ({"px": width} if width > 0 else {"factor": rounded(factor_of(slots) ** sign)})
        ]
    length = bare_length(slots)
    return [opening | ({} if length is None else {"px": length})]


def reopened(slots: Slots, said: Said) -> Effects:
    """The gap that is there, towards something else."""
    return gap(slots, said) if said.standing.groups[0].get("opening") is not None else None


def reopened_now(slots: Slots, said: Said) -> Effects:
    """The gap that the last change was about, towards something else."""
    about = bool(said.last) and said.last[-1]["kind"] == "opening"
    return reopened(slots, said) if about else None


def sided(slots: Slots, said: Said) -> Effects:
    """A side alone: the one robots stand on, or the gap is on."""
    side = str(slots["side"][0])
    moved = said.denies and not said.standing.edits  # else "left" is a way to go
    group = said.standing.groups[0]
    if (
        "too" in said.words.split()
        or side not in OPPOSITE
        or not (moved or side in ("top", "bottom"))
    ):
        return None
    if group.get("opening") is not None:
        return [{"kind": "opening", "towards": side}]
    if group.get("side"):
        return [{"kind": "side", "side": side}]
    return [{"kind": "sides", "only": [side]}] if group.get("sides") else None


def wider(slots: Slots, said: Said) -> Effects:
    """Wider alone: the gap, where there is one."""
    if said.standing.groups[0].get("opening") is not None:
        return gap(slots, said)
    if any(e["kind"] == "spacing" for e in said.last):
        factor = factor_of(slots) ** (1 if slots["wide"][0] == "wider" else -1)
        return [{"kind": "spacing", "factor": rounded(factor)}]
    if slots["wide"][0] == "wider":
        return ask("What should be wider?", "further out", "further apart")
    return ask("What should be narrower?", "closer", "closer together")


def close(slots: Slots, said: Said) -> Effects:
    """The whole ring again, without an opening; "no gap, back" takes the last one back."""
    slots.has("relation")
    if slots.has("back", "undo") and said.standing.changes:
        opened = [e["kind"] for e in said.standing.edits] == ["opening"]
        return [{"kind": "undo", "steps": 1}] if opened else [{"kind": "close"}]
    if said.standing.relation == "inside":
        return [{"kind": "arrange", "demands": {"relation": "around"}}]
    return [{"kind": "close"}]


def opened(slots: Slots, said: Said) -> Effects:
    """A cage becomes a ring that is open."""
    return [{"kind": "open"}] if said.standing.relation == "cage" else [{"kind": "opening"}]


def widened(slots: Slots, said: Said) -> Effects:
    """The one side that was left free is stood on too."""
    side = SIDE_OF.get(str((slots.get("flank") or slots.get("side") or [""])[0]), "")
    taken = list(said.standing.groups[0].get("sides") or ())
    slots.has("add", "again", "close", "back", "too")
    filled = {*slots.get("relation", ())} <= {"inside", "around"}
    return [{"kind": "close"}] if filled and {*taken, side} == {*SIDES} != {*taken} else None


def cage(slots: Slots, said: Said) -> Effects:
    """Nothing gets out, as close in as that takes."""
    if "radial" in slots and "asclose" not in slots:
        return None
    if "asclose" in slots:
        near = {"relation": "cage", "closure": "escape-proof", "clearance": None}
        return [{"kind": "arrange", "demands": near}]
    return [{"kind": "escape-proof"}]
