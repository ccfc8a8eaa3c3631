"""Edits of the plan for a frame that fits a clause, one function per frame.

Each returns effects as JSON: edits, or what else a turn does (undo, go, hold, query, talk, ask,
refuse); None where the frame does not fit the plan. "A bit" is a quarter of a distance, 15 degrees
of a turn, and 5 % of the picture's shorter side for a way.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...tools.formation.number_words import SMALL, TENS
from .followup_chunks import Chunk
from .followup_frames import Slots
from .phrases import phrase
from .standing import Standing

Effect = dict[str, Any]
Effects = list[Effect] | None
FACTOR = {"bit": 1.25, "": 1.5, "big": 2.0}
"""Factors on distances, spacings and sizes, by how much is said."""
TURN = {"bit": 15.0, "": 45.0, "big": 90.0}
"""Turns in degrees, by how much is said."""
ADDED_LENGTH = re.compile(
    r"[,;:]\s*[\w.]+ ?(?:px|pix|m\b|met|cm)\w*(?: (?:from|off|away|across|wide)\b[\w ]*)?\W*$",
    re.IGNORECASE,
)
"""A length after a change gives the total, not the change: "further out, 6 m"."""
STEP = re.compile(r"\b(?:position|place|spot|slot|step|seat)s?\b", re.IGNORECASE)
"""Words for the step from one robot of a ring to the next."""
EXACT = re.compile(
    rf"\bto (?:exactly |about |just |only |some )?(?:[0-9]|(?:{'|'.join((*SMALL, *TENS))})\b)",
    re.IGNORECASE,
)
"""Words that give the total, not the change: "increase it to 60 px"."""
CENTRE = re.compile(r"\b(?:middle|cent(?:re|er))\b", re.IGNORECASE)
IN_PICTURE = re.compile(r"\b(?:picture|image|photo|screen)\b", re.IGNORECASE)
LESSER = re.compile(r"\W*(?:not (?:so|as|that|quite)|less)\b", re.IGNORECASE)
"""Words that take part of the last change back: "not so tight"."""
SAME_WAY = re.compile(r"\bsame (?:way|direction|sense)\b", re.IGNORECASE)
UPSIDE = re.compile(r"\bupside down\b|\bon its head\b", re.IGNORECASE)
LEAST_BARE = 5
"""Least number without a unit that is read as pixels."""
SIDES = ("left", "right", "top", "bottom")
SIDE_OF = {"up": "top", "down": "bottom", **dict(zip(SIDES, SIDES, strict=True))}
ALIKE = {"long": "long", "short": "short"}
OPPOSITE = {"left": "right", "right": "left", "top": "bottom", "bottom": "top", **ALIKE}
DEGREES = {"right": 0, "down": 90, "bottom": 90, "left": 180, "up": 270, "top": 270}
RINGS = ("around", "cage")
ROWS = ("along", "between")
OTHER = "?the other one"
"""Stands for a thing that has to be found: another one like the target."""


@dataclass(frozen=True)
class Utterance:
    """A clause, and the plan and words that it is read with.

    Attributes:
        standing: the current plan, and what was done last.
        words: of the clause.
        before: effects of the clauses before it in the same line.
        denies: whether the line begins with "no".
        phrases: of the clause, each with its words.
        line: the whole line.
    """

    standing: Standing
    words: str = ""
    before: tuple[Mapping[str, Any], ...] = ()
    denies: bool = False
    phrases: tuple[tuple[Chunk, str], ...] = ()
    line: str = ""

    @property
    def kinds(self) -> set[str]:
        """Kinds of the clause's phrases."""
        return {kind for chunk, _ in self.phrases for kind in chunk.kinds}

    @property
    def last(self) -> list[Effect]:
        """The last edits: those of this line, else those of the turn before."""
        return [dict(e) for e in self.before or self.standing.edits]

    @property
    def count(self) -> int:
        """How many robots there are."""
        return len(self.standing.robots)


def ask(question: str, *options: str) -> list[Effect]:
    """Return a question as an effect, with commands that would answer it."""
    return [{"kind": "ask", "question": question, "options": options}]


def refuse(sentence: str) -> list[Effect]:
    """Return a refusal as an effect: what cannot be done, and what can."""
    return [{"kind": "refuse", "text": sentence}]


def much_of(slots: Slots) -> str:
    """Return how much: "bit", "big" or ""; "a bit more" is "bit"."""
    said = [str(m) for m in slots.get("much", ())]
    return "bit" if "bit" in said else said[0] if said else ""


def bare_length(slots: Slots) -> float | None:
    """Return the length in px; a number without a unit counts unless it is small. None if none."""
    if "px" in slots:
        return float(slots["px"][0]) if slots["px"][0] > 0 else None
    number = slots.get("num", [0])[0]
    return float(number) if number >= LEAST_BARE else None


def factor_of(slots: Slots) -> float:
    """Return the factor by which a distance, spacing or size changes."""
    for name in ("ratio", "ratio_apart", "ratio_scale"):
        if name in slots:
            return float(slots[name][0])
    return 1 + float(slots["share"][0]) if "share" in slots else FACTOR[much_of(slots)]


def rounded(value: float) -> float:
    """Round to thousandths, so that stored numbers are short."""
    return round(value, 3) + 0.0  # never -0.0


OUT_OF = re.compile(r"\b(?:out of|off)\b", re.IGNORECASE)


def offset(slots: Slots, said: Utterance) -> Effects:
    """Move robots further out or in: by px, a share, or a factor of the distance."""
    ways = set(slots["radial"])
    length = bare_length(slots)
    slots.has("away")
    strange = [t for t in slots.get("thing", ()) if t not in said.standing.targets]
    if strange and not _is_mine(strange, said):
        return None
    if len(ways) > 1 or (slots.has("num", "px") and length is None):
        return None
    kind = ways.pop()
    if said.standing.relation == "inside" and OUT_OF.search(said.words):
        return ask(f'Out of it, in "{said.words}": where to?', "around it", "left of it")
    loose = said.standing.relation == "inside" and "snug" in said.kinds and length is None
    if loose:  # inside, robots are nowhere further out
        factor = factor_of(slots)
        return [{"kind": "spacing", "factor": rounded(factor if kind == "out" else 1 / factor)}]
    if length is not None:
        exact = ADDED_LENGTH.search(said.words) or EXACT.search(said.words)
        return [{"kind": "distance" if exact else kind, "px": length}]
    if kind == "in" and "share" in slots:
        share = float(slots["share"][0])
        return [{"kind": "in", "factor": rounded(1 / (1 - share))}] if 0 < share < 1 else None
    return [{"kind": kind, "factor": rounded(factor_of(slots))}]


def _is_mine(names: Sequence[Any], said: Utterance) -> bool:
    """Return whether a single noun means the plan's only target: "further from the car"."""
    strange = len(names) == 1 and names[0][:1] == "?"
    return strange and is_noun(str(names[0])[1:]) and len(said.standing.targets) == 1


def is_noun(word: str) -> bool:
    """Return whether a word is a noun for a thing."""
    found = phrase([word], 0)
    return found is not None and found.kind == "noun"


def ratio(slots: Slots, said: Utterance) -> Effects:
    """Multiply the distance: twice, half, three times as far."""
    factor = float(slots["num"][0]) if "num" in slots else float(slots["ratio"][0])
    radial = {e["kind"] for e in said.last} <= {"out", "in", "distance"}
    if "that" in said.words.lower().split() and not (said.last and radial):
        return None
    if factor <= 0 or factor == 1:
        return None
    return [
        {"kind": "out", "factor": factor}
        if factor > 1
        else {"kind": "in", "factor": rounded(1 / factor)}
    ]


def distance(slots: Slots, said: Utterance) -> Effects:
    """Set the distance from the thing; "at least" and "at most" set it too."""
    slots.has("bound")
    if any(r != said.standing.relation for r in slots.get("relation", ())):
        return None
    length = float(slots["px"][0]) if "px" in slots else bare_length(slots)
    return None if length is None else [{"kind": "distance", "px": length}]


def spacing(slots: Slots, said: Utterance) -> Effects:
    """Set the spacing between robots (at least or exactly), or change it by a factor."""
    slots.has("bound")
    if "spacing" in slots or "ratio_apart" in slots:
        value = {"px": float(slots["px"][0])} if "px" in slots else {"factor": factor_of(slots)}
        return [{"kind": "spacing", **value}]
    if "px" in slots:
        return None
    factor = factor_of(slots)
    return [
        {
            "kind": "spacing",
            "factor": rounded(factor if slots["apart"][0] == "wide" else 1 / factor),
        }
    ]


FEW_DEGREES = 5.0
"""Least number without a unit that is an angle."""


def rotate(slots: Slots, said: Utterance) -> Effects:
    """Rotate the formation, clockwise unless stated otherwise."""
    directions = {
        *slots.get("spin", ()),
        *({"right": "cw", "left": "ccw"}.get(d, d) for d in slots.get("dir", ())),
    }
    if len(directions) > 1 or directions - {"cw", "ccw"}:
        return None
    degrees = TURN[much_of(slots)]
    for name in ("angle", "num"):
        if name in slots:
            degrees = float(slots[name][0])
    bare = float(slots["num"][0]) if "num" in slots else FEW_DEGREES
    if bare < FEW_DEGREES and not STEP.search(said.words):
        n = f"{bare:g}"
        return ask(f"Turn it by {n} of what?", f"turn {n} place clockwise", f"turn {n} degrees")
    if "num" in slots and STEP.search(said.words):
        degrees *= 360 / max(said.count, 1)  # "one place clockwise"
    sign = -1 if "ccw" in directions else 1
    last = _of_kind(said.last, "rotate")
    if "otherway" in slots or "back" in slots:
        if not any(name in slots for name in ("angle", "num", "much")) and last:
            twice = 2 if "otherway" in slots else 1  # turn back, then as far again
            return [{**last, "degrees": -twice * last["degrees"]}]
        sign = -1 if last is None or last["degrees"] > 0 else 1
    elif ("more" in slots or SAME_WAY.search(said.words)) and not directions and last:
        sign = 1 if last["degrees"] > 0 else -1
    return [{"kind": "rotate", "degrees": sign * degrees}]


def _of_kind(edits: list[Effect], *kinds: str) -> Effect | None:
    return next((e for e in reversed(edits) if e["kind"] in kinds), None)


def upended(slots: Slots, said: Utterance) -> Effects:
    """Turn it upside down, by half a turn: a V then opens to the other side."""
    upside = slots["axis"] == ["top-bottom"] and UPSIDE.search(said.words)
    return [{"kind": "rotate", "degrees": 180}] if upside else None


def mirror(slots: Slots, said: Utterance) -> Effects:
    """Mirror the formation, left for right unless stated otherwise."""
    across = {"left": "left-right", "right": "left-right", "up": "top-bottom", "down": "top-bottom"}
    across |= {"top": "top-bottom", "bottom": "top-bottom"}
    slots.has("opposite")
    ways = [w for w in (*slots.get("dir", ()), *slots.get("side", ())) if w in across]
    axis = (slots.get("axis") or [across[w] for w in ways] or ["left-right"])[0]
    return [{"kind": "mirror", "axis": axis}]


def scale(slots: Slots, said: Utterance) -> Effects:
    """Make it bigger or smaller; right after a gap was changed, the gap."""
    opens = said.standing.groups[0].get("opening") is not None
    if opens and _of_kind(said.last, "opening") and slots.has("scale"):
        factor = factor_of(slots) ** (1 if slots["scale"][0] == "bigger" else -1)
        return [{"kind": "opening", "factor": rounded(factor)}]
    if "ratio_scale" in slots:
        return [{"kind": "scale", "factor": float(slots["ratio_scale"][0])}]
    if slots["scale"][0] == "smaller" and "share" in slots:
        return [{"kind": "scale", "factor": rounded(1 - float(slots["share"][0]))}]
    if "px" in slots:
        way = {"bigger": "out", "smaller": "in"}[slots["scale"][0]]
        return [{"kind": way, "px": slots["px"][0]}] if said.standing.relation in RINGS else None
    factor = factor_of(slots)
    return [
        {
            "kind": "scale",
            "factor": rounded(factor if slots["scale"][0] == "bigger" else 1 / factor),
        }
    ]


def resized(slots: Slots, said: Utterance) -> Effects:
    """Scale it to so many times its size."""
    slots.has("size", "scale")
    factor = float(slots["num"][0] if "num" in slots else slots["share"][0])
    return [{"kind": "scale", "factor": rounded(factor)}] if factor > 0 else None


def snug(slots: Slots, said: Utterance) -> Effects:
    """Change the spacing (tighter, looser) in a row or after a change of spacing."""
    apart = bool(said.last) and said.last[-1]["kind"] == "spacing"
    if apart and LESSER.match(said.words) and "factor" in said.last[-1] and len(slots) == 1:
        last = said.last[-1]["factor"]
        if (last < 1) == (slots["snug"][0] == "wide"):
            return [{"kind": "spacing", "factor": rounded((1 + last) / 2 / last)}]
    if not apart and said.standing.relation not in ROWS:
        return None
    factor = factor_of(slots)
    wide = slots["snug"][0] == "wide"
    return [{"kind": "spacing", "factor": rounded(factor if wide else 1 / factor)}]


def heading(slots: Slots, said: Utterance) -> Effects:
    """Set which way robots look."""
    slots.has("turn", "where")
    if "unface" in slots or "current" in slots:
        return [{"kind": "heading", "to": "towards" if "current" in slots else None}]
    if "there" in slots or "other" in slots or "thing" in slots:
        named = [c.kinds.get("thing", c.kinds.get("current")) for c, _ in said.phrases]
        last = [name for name in named if name][-1:]  # "those at t1 face t2"
        if any(str(name).startswith("?") for name in named[:-1] if name not in (None, *last)):
            return None
        if _is_mine(last, said):
            return [{"kind": "heading", "to": "towards"}]
        to = where(Slots({**slots, "thing": last}) if "thing" in slots else slots, said, "face {}")
        return to if isinstance(to, list) else [{"kind": "heading", "to": to}]
    for name in ("dir", "side"):
        if name in slots and slots[name][0] in DEGREES:
            return [{"kind": "heading", "to": DEGREES[slots[name][0]]}]
    if "side" in slots:
        return None
    if "otherway" in slots:
        now = said.standing.groups[0].get("heading")
        return (
            [{"kind": "heading", "to": "away" if now == "towards" else "towards"}]
            if now in ("towards", "away")
            else None
        )
    if "inward" in slots:
        to = slots["inward"][0]
        backs = "backs" in slots["face"]
        return [
            {"kind": "heading", "to": {"towards": "away", "away": "towards"}[to] if backs else to}
        ]
    return [{"kind": "heading", "to": float(slots["angle"][0])}]


def keepout(slots: Slots, said: Utterance) -> Effects:
    """Keep robots clear of another thing."""
    mine = slots.get("current", ())
    if not (mine or slots.has("thing", "there", "other")):
        return ask(
            f'Which thing is to be kept clear of in "{said.words}"? Point at it, or name it.'
        )
    to = str(mine[0]) if mine else where(slots, said, "keep clear of {}")
    if isinstance(to, list):
        return to
    far = {"px": float(slots["px"][0])} if "px" in slots else {}
    teams = [k for k, g in enumerate(said.standing.groups, 1) if g.get("targets") == [to]]
    if far and teams:  # of the thing they stand about
        group = {"group": teams[0]} if len(said.standing.groups) > 1 else {}
        return [{"kind": "distance", **far, **group}]
    if teams:
        return [{"kind": "talk", "about": "already"}]  # robots stand off it anyway
    return [{"kind": "keep-out", "ids": [to], **far}]


def where(slots: Slots, said: Utterance, option: str = "around {}") -> str | list[Effect]:
    """Return the id of the thing meant, "?" and its words if it has to be found, or a question."""
    standing = said.standing
    if "thing" in slots:
        return str(slots["thing"][0])
    if "there" in slots and standing.pointed:
        return standing.pointed[0]
    others = standing.others()
    last = [str(e["to"]) for e in said.last if e["kind"] == "target"]
    if "there" in slots and not others and last and len(standing.groups) > 1:
        return last[-1]
    if len(others) == 1:
        return others[0]
    if others:
        return ask(f"Which thing is meant: {' or '.join(others)}?", *map(option.format, others))
    return OTHER


def centre_of(slots: Slots, said: Utterance) -> tuple[float, float] | None:
    """Return the centre that is named, of a thing, the picture or the target, px; else None."""
    if not CENTRE.search(said.words):
        return None
    if IN_PICTURE.search(said.line):
        width, height = said.standing.size
        return width / 2, height / 2
    named = str(slots.get("thing", said.standing.targets[:1] or [""])[0])
    return (said.standing.centre or {}).get(named)


def listed(numbers: Sequence[object]) -> str:
    """Return numbers or names joined for a sentence: "1, 2 and 3"; "none" if there are none."""
    *most, last = map(str, numbers or ("none",))
    return f"{', '.join(most)} and {last}" if most else last
