"""Edits of how robots are arranged, on which sides, and of gaps in their ring."""

import re
from dataclasses import replace

from ...tools.formation.contract import MAX_ROBOTS
from .drawn_forms import SIDES as PLACES
from .followup_edits import (
    ADDED_LENGTH,
    OPPOSITE,
    RINGS,
    SIDE_OF,
    SIDES,
    Effect,
    Effects,
    Utterance,
    ask,
    bare_length,
    factor_of,
    rounded,
    where,
)
from .followup_frames import Slots
from .followup_teams import TOO, count, group_of, target, whole

PUSHING = re.compile(r"\b(?:move|shift|nudge|push|pull|slide|drag)\b", re.IGNORECASE)
"""Verbs with which "all right" is a direction, not a side to stand on."""


EACH_CORNER = re.compile(r"\b(?:each|every)\b.*\bcorner", re.IGNORECASE)
STRAIGHT = re.compile(r"\bstraight (?:row|line)\b", re.IGNORECASE)
BACK_TO = re.compile(r"\bback to\b", re.IGNORECASE)
WHOLE = re.compile(r"\b(?:ring|circle|row|line|formation|v|u|star|wedge|arc)\b", re.IGNORECASE)
"""Words for the whole formation, whose width is not that of a gap."""


def sides(slots: Slots, said: Utterance) -> Effects:
    """Put robots only on some sides, or leave sides free."""
    named = [SIDE_OF.get(s, s) for s in (*slots.get("flank", ()), *slots.get("side", ()))]
    without = "neg" in slots or "free" in slots
    if "flank" not in slots and PUSHING.search(said.words):
        return None
    if not named or len(set(named)) < len(named) or ("only" in slots and without):
        return None
    if TOO.search(said.words) and not without:
        return ask(f'"{said.words}": are the robots to be there alone, or more robots there?')
    if said.standing.relation in RINGS and not {"long", "short"} & {*named}:
        return [{"kind": "sides", "without" if without else "only": named}]
    if len(named) > 1 or " half" in str(named[0]) or without:
        return None
    return [{"kind": "side", "side": named[0]}]


def opposite(slots: Slots, said: Utterance) -> Effects:
    """Change to the side opposite the one that robots stand on, or that is open."""
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


def not_that_side(slots: Slots, said: Utterance) -> Effects:
    """Leave the sides free that robots were last put on."""
    last = next((e for e in reversed(said.last) if "only" in e), None)
    named = list(last["only"]) if last else list(said.standing.groups[0].get("sides") or ())
    if not named:
        return ask(
            "Which side is to be free?",
            *(f"leave the {s} side free" for s in ("left", "right", "top", "bottom")),
        )
    return [{"kind": "sides", "without": named}]


def gap(slots: Slots, said: Utterance) -> Effects:
    """Leave a gap towards something, make it wider or narrower, or put it on the other side."""
    opening: Effect = {"kind": "opening"}
    slots.has("gap", "face")
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
        slots.has("much")
        before = 0.0 if ADDED_LENGTH.search(said.words) else said.standing.groups[0]["opening"]
        by = sign if before else 1
        width = before + by * slots["px"][0] if "px" in slots else 0.0
        return [
            opening
            | ({"px": width} if width > 0 else {"factor": rounded(factor_of(slots) ** sign)})
        ]
    length = bare_length(slots)
    return [opening | ({} if length is None else {"px": length})]


def reopened(slots: Slots, said: Utterance) -> Effects:
    """Turn an existing gap towards something else; None if there is none."""
    return gap(slots, said) if said.standing.groups[0].get("opening") is not None else None


def reopened_now(slots: Slots, said: Utterance) -> Effects:
    """Turn the gap that the last change was about towards something else."""
    about = bool(said.last) and said.last[-1]["kind"] == "opening"
    return reopened(slots, said) if about else None


def sided(slots: Slots, said: Utterance) -> Effects:
    """Read a bare side: the one that robots are to stand on, or that the gap is to be on."""
    side = str(slots["side"][0])
    moved = said.denies and not said.standing.edits  # else "left" is a direction
    moved = moved or re.search(r"\bnot\b", said.line, re.IGNORECASE) is not None
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


def wider(slots: Slots, said: Utterance) -> Effects:
    """Make it wider or narrower: the gap if there is one, else the width or the spacing."""
    if said.standing.groups[0].get("opening") is not None and not WHOLE.search(said.words):
        return gap(slots, said)
    if "px" in slots:
        slots.has("much")
        wide = "wide" in slots["wide"] or ADDED_LENGTH.search(said.words)
        return [{"kind": "scale", "px": slots["px"][0]}] if wide else None
    if any(e["kind"] == "spacing" for e in said.last):
        factor = factor_of(slots) ** (1 if slots["wide"][0] == "wider" else -1)
        return [{"kind": "spacing", "factor": rounded(factor)}]
    if slots["wide"][0] == "wider":
        return ask("What should be wider?", "further out", "further apart")
    return ask("What should be narrower?", "closer", "closer together")


def close(slots: Slots, said: Utterance) -> Effects:
    """Close the ring again; "no gap, back" takes back the last change if that opened it."""
    slots.has("relation")
    to_none = BACK_TO.search(said.words) is not None  # the gap before the last change may remain
    if slots.has("back", "undo") and said.standing.changes and not to_none:
        opened = [e["kind"] for e in said.standing.edits] == ["opening"]
        return [{"kind": "undo", "steps": 1}] if opened else [{"kind": "close"}]
    if said.standing.relation == "inside":
        return [{"kind": "arrange", "demands": {"relation": "around"}}]
    return [{"kind": "close"}]


def closed_with(slots: Slots, said: Utterance) -> Effects:
    """Close the ring with a given number of robots."""
    counted = count(slots, replace(said, phrases=()))
    if counted is None:
        return None
    return [*(close(slots, said) or ()), *(e for e in counted if e["kind"] != "talk")]


def add_on_side(slots: Slots, said: Utterance) -> Effects:
    """Add robots on one side: to the row that stands there, else ask."""
    n, groups = whole(slots), said.standing.groups
    side = SIDE_OF.get(str((slots.get("flank") or slots.get("side") or [""])[0]))
    slots.has("more", "add", "onword")
    rows = [k for k, g in enumerate(groups, 1) if side in (g.get("side"), *(g.get("sides") or ()))]
    if n is None or side is None:
        return None
    if len(rows) == 1:
        return [{"kind": "add", "n": n, **({"group": rows[0]} if len(groups) > 1 else {})}]
    question = f"Robots that are added share all of the way with the others. {n} more of them?"
    return ask(question, f"{n} more", f"{n} more, all only on the {side} side")


def opened(slots: Slots, said: Utterance) -> Effects:
    """Turn a cage into an open ring; leave a gap in any other arrangement."""
    return [{"kind": "open"}] if said.standing.relation == "cage" else [{"kind": "opening"}]


def widened(slots: Slots, said: Utterance) -> Effects:
    """Close the ring by standing on the one side that was left free."""
    side = SIDE_OF.get(str((slots.get("flank") or slots.get("side") or [""])[0]), "")
    taken = list(said.standing.groups[0].get("sides") or ())
    slots.has("add", "again", "close", "back", "too")
    filled = {*slots.get("relation", ())} <= {"inside", "around"}
    return [{"kind": "close"}] if filled and {*taken, side} == {*SIDES} != {*taken} else None


def cage(slots: Slots, said: Utterance) -> Effects:
    """Make a cage that nothing gets out of; with "as close", at the distance that takes."""
    if "radial" in slots and "asclose" not in slots:
        return None
    if "asclose" in slots:
        near = {"relation": "cage", "closure": "escape-proof", "clearance": None}
        return [{"kind": "arrange", "demands": near}]
    return [{"kind": "escape-proof"}]


def arrange(slots: Slots, said: Utterance) -> Effects:
    """Put the same robots in another arrangement."""
    named = list(dict.fromkeys(slots["relation"]))
    named = [r for r in named if r != "around"] or named
    slots.has("back", "only", "onword")
    if "along" in named and STRAIGHT.search(said.words):
        return _straight(slots, said)
    current = [str(name) for name in slots.get("current", ())]
    if "both" in named:
        ends = [name for name, _ in said.standing.things]
        between = {"relation": "between", "targets": ends}
        return [{"kind": "arrange", "demands": between}] if len(ends) == 2 else None
    if len(named) != 1 or named[0] == "shape":
        return None
    relation = named[0]
    edits: list[Effect] = []
    if slots.has("thing", "there", "other"):
        return target(slots, said)
    if relation == "between":
        return None
    if relation == said.standing.relation and not slots.has("px", "flank", "side"):
        return [_whole_again(said)]
    demands = group_of(relation, slots)
    if len(said.standing.targets) > len(said.standing.groups) and len(current) == 1:
        demands["targets"] = current  # one of two things
    edits.append({"kind": "arrange", "demands": demands})
    if "px" in slots:
        edits.append({"kind": "distance", "px": float(slots["px"][0])})
    return edits


def _whole_again(said: Utterance) -> Effect:
    """Return what makes the arrangement that stands whole where robots or sides are left out."""
    if said.standing.relation == "around" and said.standing.groups[0].get("sides"):
        return {"kind": "close"}
    return {"kind": "merge"} if said.standing.apart else {"kind": "talk", "about": "already"}


def _straight(slots: Slots, said: Utterance) -> Effects:
    """Form a straight line beside the thing; a row would follow its outline, however it bends."""
    named = str((slots.get("flank") or slots.get("side") or [""])[0])
    where = PLACES.get(named) or (None if named else said.standing.beside)
    if slots.has("thing", "there", "other", "px", "away"):
        return None
    if where is None:
        return ask("On which side?", *(f"in a straight line {w} it" for w in ("above", "below")))
    shape = {"kind": "line", "where": where}
    return [{"kind": "arrange", "demands": {"relation": "shape", "shape": shape}}]


def arranged(slots: Slots, said: Utterance) -> Effects:
    """Put a given number of robots in another arrangement."""
    n = whole(slots)
    if n is not None and EACH_CORNER.search(said.words):
        n *= 4
    if n is None or n > MAX_ROBOTS:
        return None
    given = Slots({k: v for k, v in slots.items() if k not in ("num", "lone")})
    slots.used.update(slots)
    made = arrange(given, said)
    if not made or made[0]["kind"] not in ("arrange", "close", "talk"):
        return made
    edits = [e for e in made if e["kind"] != "talk"]
    counted: list[Effect] = [] if n == said.count else [{"kind": "count", "robots": n}]
    fewer = n < said.count and any(e.get("demands", {}).get("relation") == "corners" for e in edits)
    return ([*counted, *edits] if fewer else [*edits, *counted]) or made
