"""Edits that change a named quantity, and edits of how many robots go where."""

from collections.abc import Mapping, Sequence
from typing import Any

from .followup_edits import (
    EXACT,
    Effect,
    Effects,
    Utterance,
    ask,
    factor_of,
    listed,
    rounded,
    where,
)
from .followup_frames import Slots
from .followup_teams import SHARES, how_many_fewer, how_many_more, whole
from .followup_things import known

HERE = ("here", "stay")
VAGUE = (*HERE, "there", "other")
"""Kinds of phrases for a thing that follows from the other things named."""
MODES = ("more", "add", "less", "remove", "too")
PLACING = frozenset(
    ("filler", "sep", "team", "it", "move", "about", "towards", "side_of", "robotword", "make")
) | {"relation", "again", "split", "lone", "back", "same", "instead", "onword"}
"""Kinds of phrases that do not matter for how many go where."""


def changed(slots: Slots, said: Utterance) -> Effects:
    """Change a quantity: by an amount, to an amount, or by a factor."""
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


def _teamed(slots: Slots, said: Utterance, way: str, factor: float, *, exact: bool) -> Effects:
    """Change the number of robots."""
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


def allotted(slots: Slots, said: Utterance) -> Effects:
    """Put so many robots at this thing and so many at that one, or add or remove some there."""
    standing, told = said.standing, _roles(said)
    slots.used.update(slots)
    if told is None or not standing.targets:
        return None
    groups = {str(g["targets"][0]): k for k, g in enumerate(standing.groups, 1) if _is_about_one(g)}
    if len(groups) < len(standing.groups):
        return None
    pairs, more = _matched(told, said, list(groups)), [mode for mode, _ in told if mode in MODES]
    each = ("each", None) in told
    if pairs is None or (more and len(pairs) > 1 and not each):
        return None
    if {*more} & {"more", "add"} or (more == ["too"] and not {t for t, _ in pairs} & {*groups}):
        return [{"kind": "add", "n": n, **_group_of(t, groups)} for t, n in pairs]
    if more and more != ["too"]:
        known = all(t in groups for t, _ in pairs)
        return [{"kind": "remove", "n": n, "group": groups[t]} for t, n in pairs] if known else None
    return _moved(dict(pairs), groups, said, each=each)


def handed(slots: Slots, said: Utterance) -> Effects:
    """Move so many robots from one team to another: "one from the first coin to the second"."""
    standing = said.standing
    slots.used.update(slots)
    groups = {str(g["targets"][0]): k for k, g in enumerate(standing.groups, 1) if _is_about_one(g)}
    kinds = [c.kinds for c, _ in said.phrases]
    named = [
        ("thing", k.get("thing", k.get("current"))) for k in kinds if {"thing", "current"} & {*k}
    ]
    named += [("other", k["other"]) for k in kinds if "other" in k]
    things = _resolved_things(named, said, list(groups))
    n = whole(slots)
    if things is None or len(things) != 2 or things[0] not in groups or n is None:
        return None
    group = {"group": groups[things[0]]} if len(groups) > 1 else {}
    return [{"kind": "target", "to": things[1], "robots": n, **group}]


def split_among(slots: Slots, said: Utterance) -> Effects:
    """Put as many robots at each of all things known: "split them over all three"."""
    standing = said.standing
    slots.used.update(slots)
    things = [*standing.targets, *standing.others()]
    groups = {str(g["targets"][0]): k for k, g in enumerate(standing.groups, 1) if _is_about_one(g)}
    if len(groups) < len(standing.groups) or said.count < len(things):
        return None
    named = int(slots["among"][0])
    if named not in (0, len(things)):
        known = listed(things)
        return ask(f"{len(things)} things are known, {known}, not {named}. Which ones?")
    each, rest = divmod(said.count, len(things))
    wish = {thing: each + (k < rest) for k, thing in enumerate(things)}
    return _moved(wish, groups, said, each=False)


def _is_about_one(group: Mapping[str, Any]) -> bool:
    return len(group.get("targets", ())) == 1 and group["relation"] != "at"


def _group_of(thing: str, groups: Mapping[str, int]) -> Effect:
    """Return the fields of an edit for the group about a thing, or for a new group there."""
    if thing in groups:
        return {"group": groups[thing]} if len(groups) > 1 else {}
    return {"to": thing}


def _roles(said: Utterance) -> list[tuple[str, Any]] | None:
    """Return the role and value of each phrase, in order; None where one has another role."""
    found: list[tuple[str, Any]] = []
    names = ("thing", "current", *VAGUE, "num", "portion", "each", *MODES)
    for chunk, words in said.phrases:
        name = next((n for n in names if n in chunk.kinds), "")
        value = chunk.kinds.get(name)
        if "rest" in chunk.kinds:
            name, value = "other", ""
        if name == "there" and words.lower().startswith("this"):
            name = "here"
        if name == "thing" and str(value).startswith("?"):
            value = known(str(value)[1:], said.standing)
        if name == "num" and found and found[-1][0] == "other":
            found[-1] = ("other", value)  # "the other two"
        elif name in ("thing", "current", "num", *VAGUE):
            found.append(("thing" if name == "current" else name, value))
        elif name:
            found.append((name, value if name == "portion" else None))
        elif not {*chunk.kinds} & PLACING:
            return None
    return found


def _matched(
    told: Sequence[tuple[str, Any]], said: Utterance, targets: list[str]
) -> list[tuple[str, int]] | None:
    """Return pairs of thing and number of robots; None where they do not match."""
    things = [(kind, value) for kind, value in told if kind in ("thing", *VAGUE)]
    numbers = [_count(value, said) for kind, value in told if kind in ("num", "portion")]
    each = ("each", None) in told
    if each and [kind for kind, _ in things] == ["other"]:
        others, named = said.standing.others(), things[0][1]
        if named not in ("", len(others)):
            return None
        things = [("thing", t) for t in others]
    names = _resolved_things(things, said, targets)
    if each and not things:
        names = targets if len(targets) > 1 else [*targets, *said.standing.others()]
    elif not things and len(numbers) == len(targets) > 1:
        names = targets
    if names is None or len({*names}) < len(names) or not all(numbers):
        return None
    numbers = numbers * len(names) if each and len(numbers) == 1 else numbers
    return list(zip(names, numbers, strict=True)) if len(numbers) == len(names) > 0 else None


def _count(value: Any, said: Utterance) -> int:
    """Return a number of robots, given as such or as a share; 0 if it is not a valid number."""
    if isinstance(value, str):
        return said.count // SHARES[value]
    return int(value) if value == int(value) and value > 0 else 0


def _resolved_things(
    things: Sequence[tuple[str, Any]], said: Utterance, targets: Sequence[str]
) -> list[str] | None:
    """Return the ids of things, working out "here" or "the other" from those named; else None."""
    found: list[str | None] = [str(v) if kind == "thing" else None for kind, v in things]
    if len({kind for kind, _ in things if kind != "thing"}) < found.count(None):
        return None
    for at, (kind, _) in enumerate(things):
        if kind in VAGUE:
            sought = any(str(t).startswith("?") for t in found)  # "the other" is then a known one
            rest = [] if kind in HERE or sought else said.standing.others()
            left = [t for t in (*rest, *targets) if t not in found]
            several = len([t for t in rest if t in left]) != 1 and len(left) > 1
            if several and kind != "there" and (kind == "other" or len(targets) > 1):
                return None
            told = several and kind == "there"
            sole = left[0] if left and not told else where(Slots({kind: [""]}), said)
            if not isinstance(sole, str):
                return None
            found[at] = sole
    return [t for t in found if t is not None]


def _moved(
    wish: dict[str, int], groups: Mapping[str, int], said: Utterance, *, each: bool
) -> Effects:
    """Return the edits after which the wished number of robots stands about each named thing."""
    now = {t: int(said.standing.groups[k - 1]["robots"]) for t, k in groups.items()}
    if len(wish) < 2:
        return None
    if sum(wish.values()) != said.count and each and {*wish} == {*now}:
        return [{"kind": "count", "robots": n, "group": groups[t]} for t, n in wish.items()]
    among = sum(now.get(t, 0) for t in wish)  # robots at the named things
    if sum(wish.values()) not in (among, said.count):
        if not {*wish} & {*now} and sum(wish.values()) < said.count:
            return None  # the rest stays
        numbers = " and ".join(map(str, wish.values()))
        return ask(f"There are {said.count} robots, not {numbers}. How many go where?")
    all_go = sum(wish.values()) == said.count
    spare = {t: n - wish.get(t, 0) for t, n in now.items() if n > wish.get(t, 0 if all_go else n)}
    edits: list[Effect] = []
    for thing, n in wish.items():
        for source in [*spare]:
            going = min(n - now.get(thing, 0), spare[source])
            if going > 0:
                group = {"group": groups[source]} if len(groups) > 2 else {}
                edits.append({"kind": "target", "to": thing, "robots": going, **group})
                now[thing], spare[source] = now.get(thing, 0) + going, spare[source] - going
    return edits or [{"kind": "talk", "about": "already"}]


def rejoin(slots: Slots, said: Utterance) -> Effects:
    """Take robots that stand by themselves back into the formation: "robot 3 back in"."""
    slots.used.update(slots)
    apart = {int(robot) for robot in said.standing.apart}
    named = {robot for robots in slots.get("robots", ()) for robot in robots} or apart
    kept = {*slots.get("relation", ())} <= {said.standing.relation}
    inward = {*slots.get("radial", ())} <= {"in"}
    return [{"kind": "merge"}] if apart and named == apart and kept and inward else None
