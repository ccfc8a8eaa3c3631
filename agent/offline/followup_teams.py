"""Edits of how many robots there are, of which leave or swap, and of teams and their things."""

import re

from ...tools.formation.contract import MAX_ROBOTS
from .followup_edits import (
    LEAST_BARE,
    SIDE_OF,
    Effect,
    Effects,
    Utterance,
    ask,
    listed,
    refuse,
    where,
)
from .followup_frames import Slots
from .followup_moves import place
from .followup_words import chunks_of

PLACING = re.compile(
    r"(?=.*\b(?:robot|bot|drone|rover)s?\b).*\b(?:put|place|surround|position|station|arrange)\b",
    re.IGNORECASE | re.DOTALL,
)
"""A verb that, with robots, a number of them and a thing, makes a new instruction."""
IN_A_RING = re.compile(r"\b(?:in|as|into) an? ?(?:ring|circle)|in circle\b", re.IGNORECASE)
INTO = re.compile(r"\b(?:in(?! an? | circle)|into|inside|onto|fill|cover)\b", re.IGNORECASE)
TOO = re.compile(r"\b(?:too|also|as well|aswell|in addition|additionally)\b", re.IGNORECASE)
ALIKE = re.compile(r"\b(?:same|too|also|as well|likewise)\b", re.IGNORECASE)
SHARES = {"half": 2, "third": 3, "quarter": 4}
DIRECTED = re.compile(r"^\W*(?:\w+ )?(?:(?P<up>up)|down) to\b", re.IGNORECASE)
"""Words that say whether the number goes up or down: "up to 9", "go down to five"."""
BACK_TO = re.compile(r"\bback to\b", re.IGNORECASE)
SOME_OF = re.compile(r"\bof (?:them|these|those|the robots)\b.*\bback\b", re.IGNORECASE)
"""After a number, it is one of robots that go somewhere, not of all there are to be."""
LIKE_A_RING = ("around", "cage", "corners", "shape")
"""Arrangements about a thing that "around" another thing keeps."""


def whole(slots: Slots) -> int | None:
    """Return the number given, where it can count robots, else None; "a robot" is 1."""
    if "num" not in slots and "lone" in slots:
        return 1
    number = slots.get("num", [0])[0]
    return int(number) if number == int(number) and number > 0 else None


def add_some(slots: Slots, said: Utterance) -> Effects:
    """Add a number of robots."""
    n = whole(slots)
    if n is not None and said.count + n > MAX_ROBOTS:
        return refuse(
            f"{said.count + n:,} robots are too many; at most {MAX_ROBOTS:,} can be placed."
        )
    between = slots.get("relation", ()) or slots.get("spacing", ())
    if n is None or (between and "between" not in said.words.lower().split()):
        return None
    if between and re.search(r"\b(?:each|every|all)\b", said.words, re.IGNORECASE):
        return None  # "one between each": as many as there are gaps
    if between and said.standing.relation == "corners":
        ring: Effect = {"kind": "arrange", "demands": {"relation": "around"}}
        return [ring, {"kind": "count", "robots": said.count + n}]
    return [{"kind": "add", "n": n}]


def remove_some(slots: Slots, said: Utterance) -> Effects:
    """Remove a number or a share of the robots."""
    n = said.count // SHARES[slots["portion"][0]] if "portion" in slots else whole(slots)
    if n is None:
        return None
    if n >= said.count:
        return refuse(
            f"There are {said.count} robots; at most {said.count - 1} of them can be taken away."
        )
    return [{"kind": "remove", "n": n}]


def leave(slots: Slots, said: Utterance) -> Effects:
    """Remove the robots named; the others close up unless the places are to stay empty."""
    robots = list(dict.fromkeys(r for named in slots["robots"] for r in named))
    if len(robots) >= said.count:
        return refuse("All robots would leave: nothing would be left to place.")
    slots.has("rest", "closeup", "leave", "remove")  # closing up is what the others do anyway
    return [{"kind": "skip" if slots.has("empty", "stay") else "remove", "robots": robots}]


def leave_others(slots: Slots, said: Utterance) -> Effects:
    """Remove all robots but those named."""
    slots.has("all")
    words = said.words.lower()
    if words.find("stay") > max(words.find(w) for w in ("leave", "go", "away", "out")):
        return None  # "robot 5 leaves, everybody else stays"
    named = {r for robots in slots["robots"] for r in robots}
    others = [int(r) for r in said.standing.robots if int(r) not in named]
    return [{"kind": "remove", "robots": others}] if others else None


def leave_side(slots: Slots, said: Utterance) -> Effects:
    """Remove the row on one side."""
    side = SIDE_OF.get(str((slots.get("flank") or slots.get("side") or [""])[0]))
    rows = [(k, g) for k, g in enumerate(said.standing.groups, 1) if g.get("side") == side]
    slots.has("leave", "remove", "off", "away", "radial")
    if len(rows) != 1 or len(said.standing.groups) < 2:
        return None
    return [{"kind": "remove", "n": rows[0][1]["robots"], "group": rows[0][0]}]


def leave_rest(slots: Slots, said: Utterance) -> Effects:
    """Do nothing for "the rest leaves" if the line has set the number of robots already."""
    counted = any(e["kind"] == "count" for e in said.before)
    return [{"kind": "talk", "about": "already"}] if counted else None


def emptied(slots: Slots, said: Utterance) -> Effects:
    """Remove the team about one of several things."""
    named = str((slots.get("current") or [""])[0])
    groups = list(enumerate(said.standing.groups, 1))
    here = [(k, g) for k, g in groups if g.get("targets") == [named]]
    if len(here) != 1 or len(groups) < 2:
        return None
    return [{"kind": "remove", "n": here[0][1]["robots"], "group": here[0][0]}]


def some(slots: Slots, said: Utterance) -> Effects:
    """Ask how many, where "some" of the robots are to go elsewhere."""
    slots.used.update(slots)
    return ask(f'How many of them, in "{said.words}"? Say a number.')


def count(slots: Slots, said: Utterance) -> Effects:
    """Set the number of robots in all, or multiply it."""
    slots.has("toomany", "back", "remove", "less", "only")
    n = (
        round(said.count * float(slots["ratio_count"][0]))
        if "ratio_count" in slots
        else whole(slots)
    )
    way = DIRECTED.search(said.words)
    if n is not None and way and n != said.count and (n > said.count) != bool(way["up"]):
        return ask(f"{n} of what?", f"{n} px away from it", f"make it {n} robots")
    if "back" in slots and not BACK_TO.search(said.words):
        return None
    if n is not None and n > MAX_ROBOTS:
        return refuse(f"{n:,} robots are too many; at most {MAX_ROBOTS:,} can be placed.")
    if n == said.count:
        many = "toomany" in slots
        return how_many_fewer(slots, said) if many else [{"kind": "talk", "about": "already"}]
    of_distance = bool(said.last) and said.last[-1]["kind"] in ("distance", "out", "in")
    if n and n > 2 * said.count and of_distance and "robotword" not in slots:
        return ask(f"{n} of what?", f"{n} px away from it", f"{n} robots")
    kept = re.match(r"\W*keep\b", said.words, re.IGNORECASE) is None or (n or 0) <= said.count
    return None if n is None or not kept or _rearranges(said) else [{"kind": "count", "robots": n}]


def _rearranges(said: Utterance) -> bool:
    """Return whether another arrangement is named beside a number: "six around it".

    "Around six" is none; the whole ring is one where robots stand on only a part of it.
    """
    stands = (said.standing.relation, *(LIKE_A_RING if said.standing.targets else ()))
    after = [c.kinds for c, _ in said.phrases[1:]] + [{}]
    named = [c.kinds.get("relation", stands[0]) for c, _ in said.phrases]
    group = said.standing.groups[0]
    partly = group.get("sides") or group.get("opening") is not None
    if partly and any("close" in c.kinds for c, _ in said.phrases):
        return True
    return any(
        r not in (stands if stands[0] in LIKE_A_RING else stands[:1]) and "num" not in then
        for r, then in zip(named, after, strict=False)
    )


def needed(slots: Slots, said: Utterance) -> Effects:
    """Set as many robots as close the ring."""
    slots.has("add", "close", "closeq", "relation", "again")
    return [{"kind": "count", "robots": "held" if slots.has("escape") else "needed"}]


def fit(slots: Slots, said: Utterance) -> Effects:
    """Set as many robots as there is room for."""
    slots.has("apart", "spacing", "add")
    spaced: list[Effect] = (
        [{"kind": "spacing", "px": float(slots["px"][0])}] if "px" in slots else []
    )
    return [*spaced, {"kind": "count", "robots": "fit"}]


def how_many_more(slots: Slots, said: Utterance) -> Effects:
    """Ask how many robots more."""
    return ask(
        "How many more robots?",
        "one more robot",
        "two more robots",
        f"make it {2 * said.count} robots",
    )


def how_many_fewer(slots: Slots, said: Utterance) -> Effects:
    """Ask how many robots fewer."""
    return ask("How many robots fewer?", "take one robot away", "take two robots away")


def swap(slots: Slots, said: Utterance) -> Effects:
    """Swap the places of two robots."""
    robots = [r for named in slots.get("robots", ()) for r in named] + [
        int(n) for n in slots.get("num", ())
    ]
    robots = robots[1:] if len(robots) == 3 and robots[0] == 2 else robots  # "two: 3 and 6"
    strange = [r for r in robots if str(r) not in said.standing.robots]
    if strange:
        return refuse(f"There is no robot {strange[0]}; there are {listed(said.standing.robots)}.")
    if len(robots) > 2:
        return None
    last = said.last[-1] if said.last else {}
    if len(robots) == 1 and "robot" in last and re.search(r"\b(?:it|that one)\b", said.words):
        robots = [int(last["robot"]), *robots]
    if len(robots) != 2:
        return ask(f"Which two robots swap? Of {listed(said.standing.robots)} two.")
    if robots[0] == robots[1]:
        return refuse(f"Robot {robots[0]} cannot swap with itself: name two robots.")
    return [{"kind": "swap", "a": robots[0], "b": robots[1]}]


def target(slots: Slots, said: Utterance) -> Effects:
    """Move the same arrangement to another thing."""
    slots.has("back")
    to = where(slots, said)
    if isinstance(to, list):
        return to
    if "neg" in slots and "current" not in slots and len(slots.get("other", ())) < 2:
        return None
    if "between" in slots.get("relation", ()):
        if "neg" in slots:
            return None
        ends = [*slots.get("current", ()), to]
        return (
            [{"kind": "arrange", "demands": {"relation": "between", "targets": ends}}]
            if len(ends) == 2
            else None
        )
    moved: Effect = {"kind": "target", "to": to}
    if to not in said.standing.targets and TOO.search(said.words):
        at = to.removeprefix("?")
        return ask(
            f'All {said.count} robots have places already. In "{said.words}", are some of them to '
            "go there, or more robots to come?",
            f"half of them to {at}, the rest here",
            f"{said.count} more around {at}",
        )
    last = said.last[0] if len(said.last) == 1 else {}
    if "to" in last and last["kind"] == "add" and ALIKE.search(said.words):
        return [last | {"to": to}]
    relation = slots.get("relation", ["around"])[0]
    if relation == "around" and not said.standing.targets:
        return [{"kind": "arrange", "demands": {"relation": relation, "targets": [to]}}]
    kept = relation == said.standing.relation or (
        relation == "around" and said.standing.relation in LIKE_A_RING
    )
    as_it_is = "same" in slots and not IN_A_RING.search(said.words)
    if as_it_is or "relation" not in slots or kept:
        return [moved]
    return (
        [moved, {"kind": "arrange", "demands": group_of(relation, slots)}]
        if relation != "shape"
        else None
    )


def not_this(slots: Slots, said: Utterance) -> Effects:
    """Move the same arrangement from this thing to another one."""
    this = str((slots.get("current") or slots.get("thing") or [""])[0])
    if "there" not in slots or (this.startswith("?") and len(said.standing.targets) > 1):
        return None
    to = where(Slots({"there": [""]}), said)
    return to if isinstance(to, list) else [{"kind": "target", "to": to}]


def split(slots: Slots, said: Utterance) -> Effects:
    """Move some of the robots to another thing; the rest stays."""
    named = [r for robots in slots.get("robots", ()) for r in robots]
    relation = (slots.get("relation") or ["around"])[0]
    slots.has("merge", "here", "rest", "back", "undo")
    if relation not in ("around", said.standing.relation):
        return None
    if named and not slots.has("rest", "portion", "split"):
        return None if "num" in slots else place(slots, said)
    some = named or _number_going(slots, said)
    fresh = PLACING.search(said.words) and not slots.has("rest", "here", "stay", "portion")
    if some is None or (fresh and not named):
        return None
    if not slots.has("there", "other", "thing"):
        parted = "split" in slots or len(slots.get("portion", ())) > 1
        return split_ask(slots, said) if parted else None
    to = where(slots, said, f"{listed(named) if named else some} of them to {{}}")
    if isinstance(to, list):
        return to
    joins = len(said.standing.groups) > 1 and not slots.has("leavegap")
    if to in said.standing.targets and not joins:
        return None
    moved: Effect = {"kind": "target", "to": to}
    inside = said.standing.relation == "inside"
    if some == said.count:
        ringed = inside and "relation" in slots and not INTO.search(said.words)
        return [moved, {"kind": "arrange", "demands": {"relation": "around"}}][: 1 + ringed]
    stays = {"stay": True} if "stay" in slots else {}
    parted = moved | {"robots": some} | stays
    known = {t for g in said.standing.groups for t in g.get("targets", ())}
    if not inside or to in known or INTO.search(said.words):
        return [parted]
    ring = {"relation": "around"}  # they go to it, and not onto it
    return [parted, {"kind": "arrange", "demands": ring, "group": len(said.standing.groups) + 1}]


def _number_going(slots: Slots, said: Utterance) -> int | None:
    """Return how many robots go elsewhere; None where that is not given, or more than there are."""
    if "portion" in slots:
        part = said.count // SHARES[slots["portion"][0]]
        return None if "num" in slots else max(part, 1)
    if "addone" in slots:
        return 1
    if "num" not in slots:
        return said.count // 2 if slots.has("split", "rest") else None
    n = whole(slots)
    return n if len(set(slots["num"])) == 1 and n is not None and n <= said.count else None


def split_ask(slots: Slots, said: Utterance) -> Effects:
    """Make two teams; ask where the second is to stand unless only one other thing is known."""
    others = said.standing.others()
    if len(others) == 1:
        return [{"kind": "target", "to": others[0], "robots": said.count // 2}]
    options = [f"half of them to {t}, the rest here" for t in others]
    return ask(
        "Two teams: what is the second one to stand around? Point at it, or name it.", *options
    )


def merge(slots: Slots, said: Utterance) -> Effects:
    """Join all teams into one."""
    if len(said.standing.groups) < 2:
        return [{"kind": "talk", "about": "already"}]
    to = (slots.get("thing") or slots.get("current") or [None])[0]
    return [{"kind": "merge"} | ({} if to is None else {"to": to})]


def merge_to(slots: Slots, said: Utterance) -> Effects:
    """Put all robots around one thing, as one team where there are several."""
    if len(said.standing.groups) < 2:
        return target(slots, said)
    slots.has("back", "relation", "undo")
    return [{"kind": "merge", "to": slots["thing"][0]}]


def even_out(slots: Slots, said: Utterance) -> Effects:
    """Even out the gaps that were left."""
    slots.has("rest")
    if slots.get("num", [said.count]) != [said.count]:
        return None
    demands = {"relation": said.standing.relation, "spacing": "even"}
    return [{"kind": "arrange", "demands": demands}]


def few_away(slots: Slots, said: Utterance) -> Effects:
    """Read "two away" as robots to remove: a number this small is not in pixels."""
    if re.fullmatch(r"\W*[2-9] out\W*", said.words):
        n = whole(slots)
        options = (f"take {n} robots away", f"robot {n} leaves", f"robot {n} further out")
        return ask(f"{n} robots, or robot {n}?", *options)
    few = slots["num"][0] < LEAST_BARE
    return remove_some(slots, said) if few else None


def swap_again(slots: Slots, said: Utterance) -> Effects:
    """Swap two robots if others were swapped last or the last words were about a swap."""
    asked = [k for c in chunks_of(said.standing.said, said.standing) for k in c.kinds]
    swapped = said.last and said.last[-1]["kind"] == "swap"
    return swap(slots, said) if swapped or "swap" in asked else None


def add_one(slots: Slots, said: Utterance) -> Effects:
    """Add another robot if robots were added last, else ask whether a robot or a thing is meant."""
    if any(e["kind"] == "add" for e in said.last):
        return [{"kind": "add", "n": 1}]
    return ask("Another robot, or another thing?", "one more robot", "around the other one")


def group_of(relation: str, slots: Slots) -> Effect:
    """Return the fields of an arrangement's group; a circle is drawn about any thing."""
    if relation == "circle":
        return {"relation": "shape", "shape": {"kind": "circle", "where": "around"}}
    group: Effect = {"relation": relation}
    if relation == "along":
        slots.has("onword", "only")
        said = str((slots.get("flank") or slots.get("side") or ["long"])[0])
        group["side"] = SIDE_OF.get(said, said)
    return group | ({"closure": "ring"} if relation == "cage" else {})
