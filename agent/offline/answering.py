"""The offline planner's replies in a conversation: who moves, what is measured, small talk."""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Any

from ...tools.formation.units import length_text
from ..messages import History, Reply
from .followup import Followup
from .followup_edits import RINGS, ROWS, SIDES, listed
from .followups import NO_PLAN
from .standing import Standing

PAIRWISE = ("extent", "pair", "near", "bound")
"""Questions that need the places of all robots."""
MOST_NAMED = 4
"""Most robots whose distances are given one by one."""
HELP = (
    "Say what to change: further out, closer, exactly 20 px away, two more robots, only on the "
    "left, turn it 30 degrees, leave a gap towards the top, the same around the other one, half of "
    "them there, fill it instead, robot 3 a bit to the left, robot 4 leaves, undo. Ask how far "
    "robot 4 is, or whether it is closed. Nothing moves until you say go."
)
BEGIN = (
    "Say what the robots should do, such as: surround the coin with 6 robots, cage the largest "
    "coin with 10 robots, fill the pool with 6 robots, or put 5 robots in a row to the left of the "
    "car. Point at the thing too where its look does not tell it. Nothing moves until you say go."
)
ROBOTS_STAY = "The robots do not move back by themselves; say go for that."


def talk(followup: Followup, standing: Standing | None, before: History) -> str:
    """Return the answer to words that ask for no change."""
    about = followup.about if followup.kind == "talk" else ""
    advice = BEGIN if standing is None else HELP
    if about == "help":
        return advice
    if about == "thanks":
        return "You are welcome."
    if about == "hello":
        return f"Hello. {advice}"
    if standing is None:
        return _why(before) if about == "why" else NO_PLAN
    if about == "why":
        return _why(before)
    if about == "did":
        edits = ", ".join(str(e["kind"]) for e in standing.edits) or "a new plan"
        return (
            f'After "{standing.words}": {edits}; plan {standing.plan} stands.'
            if standing.words
            else f"Plan {standing.plan} stands."
        )
    if about == "steps":
        n = standing.changes
        return f"{n} change{'s' * (n != 1)} can be taken back."
    if about == "sides":
        told = [_free_sides(g) for g in standing.groups if g["relation"] in (*RINGS, *ROWS)]
        return " ".join(told) or "The plan keeps no side free: no robots stand around or along it."
    if about == "already":
        return f"That is so already; plan {standing.plan} stands as it is."
    groups = "; ".join(
        f"{g['robots']} robots {g['relation']} {' and '.join(g.get('targets', ()))}"
        for g in standing.groups
    )
    driven = "the robots stand there" if standing.deployed else "the robots are not there yet"
    return f"Plan {standing.plan}: {groups}; {driven}."


def _free_sides(group: Mapping[str, Any]) -> str:
    """Return a sentence on which sides of its thing a group leaves free, according to the plan."""
    thing, taken = listed(group.get("targets", ())), group.get("sides") or [group.get("side")]
    if not {*SIDES} >= {*taken} - {None}:
        return f"The plan keeps no side of {thing} free by name."
    opened = group.get("opening_towards")
    gap = f" There is a gap towards {opened}." if opened else ""
    free = [side for side in SIDES if taken != [None] and side not in taken]
    if not free:
        return f"Robots stand on all sides of {thing}.{gap}"
    return f"Free at {thing}: {listed(free)}; robots stand {listed(taken)}.{gap}"


def _why(before: History) -> str:
    """Return the last reply or reported reason of the conversation, as the answer to "why"."""
    for message in reversed(before):
        if isinstance(message, Reply):
            told = message.text or next(
                (str(c.arguments["reason"]) for c in message.calls if "reason" in c.arguments), ""
            )
            if told:
                return f"As I said: {told}"
    return "Nothing was refused or changed yet."


def said_of_edit(data: Mapping[str, Any], scale: float | None) -> str:
    """Return the reply to a change: who moves, and how far."""
    said = [
        f"{data['robots']} robots have certified places (plan {data['plan_id']}):",
        _moves(data, scale),
    ]
    return " ".join([*said, *data.get("notes", ())])


def _moves(data: Mapping[str, Any], scale: float | None) -> str:
    moving, staying, moves = data.get("moving", 0), data.get("staying", 0), data.get("moves", ())
    parts: list[str] = []
    if 0 < moving <= MOST_NAMED:
        parts.append(
            ", ".join(f"robot {m['robot']} goes {length_text(m['px'], scale)}" for m in moves)
        )
    elif moving:
        longest = length_text(data["longest_px"], scale)
        parts.append(f"{moving} go, robot {moves[0]['robot']} the furthest, {longest}")
    for name, verb in (("added", "added"), ("removed", "gone")):
        if data.get(name):
            parts.append(f"robot{'s' * (len(data[name]) > 1)} {listed(data[name])} {verb}")
    parts.append(f"{staying} stay{'s' * (staying == 1)}" if staying else "none stays")
    return ", ".join(parts) + "."


def said_of_undo(followup: Followup, data: Mapping[str, Any], scale: float | None) -> str:
    """Return the reply to steps back or forward: which plan stands now."""
    if data["plan_id"] is None:
        return f"The first plan is taken back: no plan stands. {ROBOTS_STAY}"
    where = (
        "The first plan stands again" if followup.to else "Back" if followup.undo > 0 else "Forward"
    )
    return f"{where}: plan {data['plan_id']}, {_moves(data, scale)} {ROBOTS_STAY}"


def arrived(data: Mapping[str, Any], scale: float | None) -> str:
    """Return the reply on what was observed after the robots moved."""
    if "why" in data:
        return str(data["why"])
    if "followed" in data:
        return str(data["followed"])
    worst = f"{length_text(data['worst_residual_px'], scale)} from its place"
    if data.get("already_there"):
        return f"All stand there already; the furthest is {worst}."
    if data["arrived"]:
        return f"All arrived; the furthest is {worst}. {data.get('reason', '')}".rstrip()
    return f"Not all arrived after {data['corrections']} corrections. {data['reason']}"


def heading_text(standing: Standing) -> str:
    """Return a sentence on which way robots look, according to the current plan."""
    told: list[str] = []
    for group in standing.groups:
        to = group.get("heading")
        ways = {"towards": "at", "away": "away from"}
        at = f"{ways[to]} {listed(group['targets'])}" if to in ways else f"at {to}"
        turned = f"{to} degrees, clockwise from the right of the picture"
        way = turned if isinstance(to, int | float) else at if to else "no way that was asked for"
        told.append(f"{group['robots']} robots look {way}")
    return f"{'; '.join(told)}."


def query_text(query: Mapping[str, Any], data: Mapping[str, Any], scale: float | None) -> str:
    """Return the answer to a question about the plan, from what was measured."""
    if "length_px" in data:
        length, width = (length_text(data[name], scale) for name in ("length_px", "width_px"))
        return f"{data['target']} is {length} long and {width} wide."
    if "nearest_px" in data:
        nearest, centres = (length_text(data[n], scale) for n in ("nearest_px", "centres_px"))
        which = [f"robot {robot}" for robot in query.get("robots", ())]
        which += [str(query["thing"])] if which and "thing" in query else []
        lead = f"{listed(which).capitalize()}: " if which else ""
        return f"{lead}{nearest} (centre to centre {centres})."
    if data.get("robots", 0) > len(data["each"]) and query["about"] in PAIRWISE:
        return f"Only {len(data['each'])} robots are measured one by one; ask about one by number."
    rows = [r for r in data["each"] if int(r["robot"]) in query.get("robots", [int(r["robot"])])]
    return ANSWERS[query["about"]](query, data, rows, scale)


Rows = Sequence[Mapping[str, Any]]
Answer = Callable[[Mapping[str, Any], Mapping[str, Any], Rows, float | None], str]


def _distance(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    measured = [r for r in rows if "target_px" in r]
    if not measured:
        return "They stand about no thing."
    if len(measured) <= MOST_NAMED:
        return (
            "; ".join(
                f"Robot {r['robot']} is {length_text(r['target_px'], scale)} from {r['target']}"
                for r in measured
            )
            + "."
        )
    ways = [r["target_px"] for r in measured]
    least, most = length_text(min(ways), scale), length_text(max(ways), scale)
    things = listed(list(dict.fromkeys(r["target"] for r in measured)))
    return f"The robots are {least} to {most} from {things}."


def _spacing(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    ways = [r["neighbour_px"] for r in rows if "neighbour_px" in r]
    if not ways:
        return "There is one robot only."
    least, most = length_text(min(ways), scale), length_text(max(ways), scale)
    return f"Each is {least} to {most} from its nearest neighbour."


def _nearest(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    measured = [r for r in rows if "target_px" in r]
    if not measured:
        return "They stand about no thing."
    choose = max if query.get("most") == "furthest" else min
    row = choose(measured, key=lambda r: r["target_px"])
    touching = f"{'Yes' if row['target_px'] <= 0 else 'No'}: " if query.get("touch") else ""
    way = length_text(row["target_px"], scale)
    return f"{touching}{'r' if touching else 'R'}obot {row['robot']}: {way} from {row['target']}."


def _closed(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    told: list[str] = []
    for group in data["groups"]:
        if "closed" not in group:
            continue
        width = length_text(group["widest_opening_px"], scale)
        widest = f"the widest opening, between robots {listed(group['between'])}, is {width}"
        needed = "" if group["closed"] or group["opened"] else f"; {_enough(group)}"
        told.append(f"{'Yes, closed' if group['closed'] else 'No, not closed'}: {widest}{needed}.")
    return " ".join(told) or f"They stand in no ring. {_spacing(query, data, rows, scale)}"


def _needed(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    rings = [g for g in data["groups"] if "closed" in g]
    if not rings:
        return "They stand in no ring, so none would close it."
    if rings[0]["closed"]:
        return f"It is closed with the {data['robots']} robots there are."
    enough = _enough(rings[0])
    return f"{enough[0].upper()}{enough[1:]}; there are {data['robots']}."


def _enough(group: Mapping[str, Any]) -> str:
    """Return how many robots would close a ring, or that no such number is known."""
    if group["robots_to_close"] is None:
        return "so far from it no number of robots is known to close it"
    return f"{group['robots_to_close']} evenly spaced robots would close it"


def _count(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    if len(data["each"]) < data["robots"]:
        return f"{data['robots']} robots."
    at: dict[str, list[str]] = {}
    for row in data["each"]:
        at.setdefault(row.get("target", "no thing"), []).append(str(row["robot"]))
    if "thing" in query:
        names = at.get(query["thing"], [])
        return (
            f"{len(names)} at {query['thing']}{': ' if names else ''}{listed(names or ['none'])}."
        )
    told = f"{data['robots']} robots: {listed([str(r['robot']) for r in data['each']])}."
    each = (f"{len(names)} at {thing}: {listed(names)}" for thing, names in at.items())
    return f"{told} {'; '.join(each)}." if len(at) > 1 else told


def _bound(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    ways = [row[query["of"]] for row in rows if query["of"] in row]
    told = (_spacing if query["of"] == "neighbour_px" else _distance)(query, data, rows, scale)
    if not ways or not query["sign"]:
        return told
    lowest = (query["sign"] == ">") != query["some"]
    end = min(ways) if lowest else max(ways)
    holds = end >= query["px"] if query["sign"] == ">" else end <= query["px"]
    return f"{'Yes' if holds else 'No'}: {told[0].lower()}{told[1:]}"


def _pair(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    pairs = [(math.dist(a["place"], b["place"]), a, b) for a, b in combinations(rows, 2)]
    if not pairs:
        return "There is one robot only."
    closest = query.get("most") == "nearest"
    way, a, b = (min if closest else max)(pairs, key=lambda pair: pair[0])
    which = "closest" if closest else "furthest apart"
    length = length_text(round(way, 1), scale)
    return f"Robots {listed([a['robot'], b['robot']])} are the {which}: {length}, centre to centre."


def _extent(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    spans = (max(v) - min(v) for v in zip(*(row["place"] for row in rows), strict=True))
    wide, high = (length_text(round(span, 1), scale) for span in spans)
    return f"{_pair(query, data, rows, scale)} All of it is {wide} wide and {high} high."


def _nearest_of(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    places = {f"robot {row['robot']}": row["place"] for row in rows}
    to = query["to"]
    at = places.pop(to) if isinstance(to, str) else to
    ways = {robot: math.dist(place, at) for robot, place in places.items()}
    if not ways:
        return "There is no other robot."
    end = (max if query["most"] == "furthest" else min)(ways.values())
    fit = [robot for robot, way in ways.items() if abs(way - end) < 1]
    place = to if isinstance(to, str) else f"({to[0]:g}, {to[1]:g})"
    return f"{listed(fit).capitalize()}: {length_text(round(end, 1), scale)} from {place}."


def _arrival(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    if data["arrived"]:
        return "Yes, all stand at their places."
    if "there" not in data:
        return "No: no robot has moved to this plan yet; say go."
    way = length_text(data["furthest_px"], scale)
    return (
        f"No: {data['there']} of {data['robots']} robots stand at their places; robot "
        f"{data['furthest']} is the furthest from its own, {way}. Say go."
    )


def _where(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    stands: list[str] = []
    for row in rows:
        x, y = row.get("at", row["place"])
        verb = "stands at" if "at" in row else "is to stand at"
        stands.append(f"robot {row['robot']} {verb} ({x:g}, {y:g})")
    text = "; ".join(stands)
    return text[:1].upper() + text[1:] + "."


def _certified(
    query: Mapping[str, Any], data: Mapping[str, Any], rows: Rows, scale: float | None
) -> str:
    again = "and is certified once more before any robot moves"
    return f"Plan {data['plan_id']} was certified when it was made, {again}."


ANSWERS: dict[str, Answer] = {
    "distance": _distance,
    "spacing": _spacing,
    "nearest": _nearest,
    "closed": _closed,
    "needed": _needed,
    "count": _count,
    "bound": _bound,
    "pair": _pair,
    "extent": _extent,
    "size": _extent,
    "near": _nearest_of,
    "arrived": _arrival,
    "place": _where,
    "certified": _certified,
}
