"""From a frame to edits of how much, of a quantity that is named, and of how many go where."""

from .followup_edits import EXACT, Effect, Effects, Said, ask, factor_of, rounded, where
from .followup_frames import Slots
from .followup_teams import how_many_fewer, how_many_more, whole

HERE = ("here", "stay")
VAGUE = (*HERE, "there", "other")
"""Kinds of phrases for a thing that is told from the others that are named."""


def changed(slots: Slots, said: Said) -> Effects:
    """More or less of a quantity: by so much, to so much, or by a factor."""
    way, of = str(slots["grow"][0]), str(slots["quantity"][0])
    exact = way == "set" or EXACT.search(said.words) is not None
    if way == "set" and not {"px", "num"} & {*slots}:
        return None
    px = float(slots["px"][0]) if "px" in slots else None
    slots.has("bound", "exactly", "spacing", "again", "more")
    of = "spacing" if "spacing" in slots else of
    factor = float(way) if way[0].isdecimal() else factor_of(slots)
    if way == "down":
        factor = 1 - float(slots["share"][0]) if "share" in slots else 1 / factor
    if of == "number":
        return _teamed(slots, said, way, factor, exact=exact)
    if "num" in slots or factor <= 0:
        return None
    if px is not None and (of == "spacing" or exact):
        kinds = {"spacing": "spacing", "distance": "distance"}
        return [{"kind": kinds[of], "px": px}] if exact and of in kinds else None
    if px is not None:
        ways = {"up": "out", "down": "in"}
        return [{"kind": ways[way], "px": px}] if way in ways else None
    if of == "distance":
        out = factor > 1
        return [{"kind": "out" if out else "in", "factor": rounded(factor if out else 1 / factor)}]
    return [{"kind": {"size": "scale"}.get(of, of), "factor": rounded(factor)}]


def _teamed(slots: Slots, said: Said, way: str, factor: float, *, exact: bool) -> Effects:
    """More or fewer robots."""
    n = whole(slots)
    if "num" not in slots and way[0].isdecimal():
        return [{"kind": "count", "robots": max(round(said.count * factor), 1)}]
    if "num" not in slots:
        return how_many_more(slots, said) if way == "up" else how_many_fewer(slots, said)
    if n is None or (exact and way != "set" and (n > said.count) != (way == "up")):
        return None
    if exact:
        return [{"kind": "count", "robots": n}]
    fewer = way == "down"
    return None if fewer and n >= said.count else [{"kind": "remove" if fewer else "add", "n": n}]


def parted(slots: Slots, said: Said) -> Effects:
    """So many about one thing, so many about another: all of them are named."""
    numbers = [int(n) for n in slots["num"]]
    slots.has("relation", "make", "portion", "split")
    if not said.standing.targets:
        return None
    told = [(k, str(v)) for k in slots if k in (*VAGUE, "thing", "current") for v in slots[k]]
    names = [name for kind, name in told if kind not in VAGUE] if told else said.standing.targets
    for at, (kind, _) in enumerate(told):
        if kind in VAGUE:
            known = said.standing.targets
            if kind not in HERE and not any(name.startswith("?") for name in names):
                known = [*said.standing.others(), *known]
            left = [t for t in known if t not in names]
            found = left[0] if left else where(Slots({kind: [""]}), said)
            if not isinstance(found, str) or len(left) > 2:
                return None
            names.insert(at, found)
    vague = [kind for kind, _ in told if kind in VAGUE]
    if len({*names}) != 2 or len({*vague}) < len(vague) or len(numbers) != 2:
        return None
    if sum(numbers) != said.count:
        if not {*names} & {*said.standing.targets}:
            return None
        a, b = numbers
        return ask(f"There are {said.count} robots, not {a} and {b}. How many go where?")
    now = {t: g["robots"] for g in said.standing.groups for t in g.get("targets", ())}
    if {*now} - {*names}:
        return None
    more = {t: n - now.get(t, 0) for t, n in zip(names, numbers, strict=True)}
    edits: list[Effect] = [
        {"kind": "target", "to": t, "robots": n} for t, n in more.items() if n > 0
    ]
    return edits or [{"kind": "talk", "about": "already"}]


def to_each(slots: Slots, said: Said) -> Effects:
    """So many about each of several things: more or fewer there, in all, or shared out evenly."""
    groups, n = said.standing.groups, whole(slots)
    slots.has("relation", "make", "same", "again")
    if not all(str(name).startswith("?") for name in slots.get("thing", ())):
        return None
    if "portion" in slots or n is None:
        half = "split" in slots or list(slots.get("portion", ())) == ["half"]
        n = said.count // 2 if half and "num" not in slots else None
    if n is None:
        return None
    kind = "add" if slots.has("add", "more") else "remove" if slots.has("remove", "less") else ""
    if len(groups) > 1 and kind:
        return [{"kind": kind, "n": n, "group": k} for k in range(1, len(groups) + 1)]
    others = said.standing.others()
    if kind or len(groups) + len(others) != 2:
        return None
    if len(groups) > 1:
        return [{"kind": "count", "robots": n, "group": k} for k in (1, 2)]
    if 2 * n != said.count:
        return ask(f"There are {said.count} robots, not twice {n}. How many go where?")
    return [{"kind": "target", "to": others[0], "robots": n}]
