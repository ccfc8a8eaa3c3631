"""Edits that move robots without rearranging them: all of them, or single ones elsewhere."""

import re

from .followup_edits import (
    FACTOR,
    Effect,
    Effects,
    Utterance,
    ask,
    bare_length,
    centre_of,
    listed,
    much_of,
    where,
)
from .followup_frames import Slots

WAY = {"bit": 0.05, "": 0.1, "big": 0.2}
"""Lengths of moves as shares of the picture's shorter side, by how much is said."""
TEAM = re.compile(
    r"\b(?:them|they|all|every\w*|robots|ring|circle|row|team|formation|whole)\b", re.IGNORECASE
)
VECTOR = {"left": (-1, 0), "right": (1, 0), "up": (0, -1), "down": (0, 1)}


def way(slots: Slots, said: Utterance) -> tuple[float, float] | None:
    """Return the move left, right, up or down, as x and y in px; None where it is not clear."""
    vectors = [VECTOR[d] for d in slots["dir"]]
    length = bare_length(slots)
    if (
        len(vectors) > 2
        or len({abs(x) for x, _ in vectors}) < len(vectors)
        or (slots.has("num", "px") and length is None)
    ):
        return None
    share = float(slots["share"][0]) if "share" in slots else WAY[much_of(slots)]
    length = round(share * min(said.standing.size)) if length is None else length
    return sum(x for x, _ in vectors) * length, sum(y for _, y in vectors) * length


BESIDE = re.compile(
    r"\b(?:to|on) the (?:left|right|top|bottom)(?:[- ]hand)?(?: side)? of\b|\b(?:to|on) its\b|"
    r"\bon the (?:left|right)\b|"
    r"\b(?:[0-9]+|[a-z]+) (?:(?:of the|more) )?(?:robots|bots|drones|rovers)\b"
    r"(?<!the robots)(?<!all robots)(?<!these robots)[^,;.]*\bto the (?:left|right)\b",
    re.IGNORECASE,
)
"""Words for where robots stand or how many go: "to the left of it", "5 robots to the left"."""


NUDGED = re.compile(r"\b(?:nudge|move|push|shift|slide|bring|pull|get|put) [0-9]+ ", re.IGNORECASE)
"""Words with which a number may name a robot or a distance."""


def shift(slots: Slots, said: Utterance) -> Effects:
    """Move all robots left, right, up or down; after moves of single robots, those."""
    by = None if BESIDE.search(said.words) else way(slots, said)
    if by is None:
        return None
    if "num" in slots and "px" not in slots and NUDGED.search(said.words):
        n = int(slots["num"][0])
        if 1 <= n <= said.count:  # "nudge 5 to the left": a robot, or as far?
            rest = said.words[said.words.find(str(n)) + len(str(n)) :].strip()
            return ask(f"{n} of what?", f"robot {n} a bit {rest}", f"{n} px {rest}")
    placed = [e["robot"] for e in said.last if e["kind"] == "place"]
    if placed and len(placed) == len(said.last) and not TEAM.search(said.words):
        return [{"kind": "place", "robot": r, "by": list(by)} for r in placed]
    return [{"kind": "shift", "dx": by[0], "dy": by[1]}]


def approach(slots: Slots, said: Utterance) -> Effects:
    """Move all robots some way towards a thing."""
    current = slots.get("current")
    to = str(current[-1]) if current else where(slots, said, "towards {}")
    if isinstance(to, list):
        return to
    slots.has("all")
    centres = said.standing.centre or {}
    now = [centres[t] for t in said.standing.targets if t in centres]
    if to not in centres or not now:
        return None
    x, y = (centres[to][k] - sum(c[k] for c in now) / len(now) for k in (0, 1))
    far = (x * x + y * y) ** 0.5
    if not far:
        return None
    px = bare_length(slots) or WAY[much_of(slots)] * min(said.standing.size)
    return [{"kind": "shift", "dx": round(x / far * px, 1), "dy": round(y / far * px, 1)}]


def place(slots: Slots, said: Utterance) -> Effects:
    """Move single robots: to a point, to a thing, or some way on."""
    robots = [r for named in slots["robots"] for r in named]
    if slots.has("relation", "inward"):
        to = centre_of(slots, said)
        return to and place(Slots({"robots": slots["robots"], "point": [to]}), said)
    point = (
        slots["point"][0] if "point" in slots else said.standing.place if "there" in slots else None
    )
    if point is not None and not (len(robots) > 1 and "there" in slots and said.standing.pointed):
        if len(robots) > 1:
            return ask(f"Only one robot can stand at a point. Which of {listed(robots)}?")
        return [{"kind": "place", "robot": robots[0], "to": list(point)}]
    if slots.has("there", "other", "thing"):
        if "there" in slots and not (said.standing.pointed or said.standing.others()):
            return ask(f'Which place is meant in "{said.words}"? Point at it, or say it as x,y.')
        to = where(slots, said, f"robot {robots[0]} to {{}}")
        if isinstance(to, list):
            return to
        alone: Effect = {"kind": "place", "robot": robots[0], "target": to}
        return [{"kind": "target", "to": to, "robots": robots} if len(robots) > 1 else alone]
    slots.has("away")
    if slots.has("dir") and slots.has("radial"):
        return None
    if "dir" in slots:
        by = way(slots, said)
        return (
            None if by is None else [{"kind": "place", "robot": r, "by": list(by)} for r in robots]
        )
    ways, length = set(slots.get("radial", ())), bare_length(slots)
    if len(ways) != 1 or (length is None and slots.has("num", "px")):
        return None
    way_on = str(ways.pop())
    by = _some_way(way_on, slots, said) if length is None else {way_on: length}
    return [{"kind": "place", "robot": r, "by": by} for r in robots]


def _some_way(way: str, slots: Slots, said: Utterance) -> dict[str, float]:
    """Return a robot's way as a factor on its distance, and the most that it may be, px."""
    most = round(WAY[much_of(slots)] * min(said.standing.size))
    return {way: most, "factor": FACTOR[much_of(slots)]}
