"""Resolves phrases of a follow-up to the known things and robots that they name."""

import re
from collections.abc import Sequence
from dataclasses import replace

from .followup_chunks import Chunk
from .followup_edits import SIDE_OF, listed
from .phrases import phrase as thing_phrase
from .phrases import table
from .reading import unscaled
from .standing import Standing

POINTING = ("that", "this", "here")
"""Words that mean what is pointed at, if something is."""
UNNAMED = ("thing pointed at", "the thing pointed at")
"""How the label of a thing begins that nobody named."""
SIDES = {"upper": "top", "lower": "bottom", "leftmost": "left", "rightmost": "right"}


def pointing_at(words: str) -> str:
    """Return words with "it" as "this", as something new is pointed at while they are said."""
    shown = re.search(r"\b(?:this|that|here|there|these|t[0-9]+)\b", words, re.IGNORECASE)
    return words if shown else re.sub(r"\bit\b", "this", words, count=1)


ACROSS = re.compile(r"side of (?:the )?(.+)")
"""Words after "the other" for the side opposite: "the other side of the crate"."""
GOING = re.compile(
    r"^(?!.*\b(?:back|undo|again)\b).*\b(?:all|everyone|everybody|them|robots?|half|two|three)\b.* "
    r"(?:to|around|round|at) $",
    re.IGNORECASE,
)
"""Words before "the first one" with which it is a thing that robots go to, and no plan."""


def resolved(chunk: Chunk, text: str, standing: Standing) -> Chunk:
    """Return a phrase with a known thing as its id; a target of the plan becomes `current`."""
    kinds = dict(chunk.kinds)
    pointed = bool(standing.pointed) or standing.place is not None
    word = text[chunk.start : chunk.end].lower()
    apart = word == "here" and re.search(r"\bthere\b", text, re.IGNORECASE)
    if pointed and word in POINTING and not apart:
        kinds["there"] = ""
    if "lone" in kinds and len(standing.robots) == 1:
        kinds["team"] = ""
    one = "first" in kinds and text[chunk.start : chunk.end].lower().endswith(" one")
    if one and len(standing.things) > 1:  # "the first one" may be a plan or a thing
        kinds["thing"] = standing.things[0][0]
        if GOING.search(text[: chunk.start]):
            del kinds["first"]
    if "thing" in kinds:
        another = re.search(r"\banother $", text[: chunk.start], re.IGNORECASE)
        other = bool(kinds.pop("other", False) or another)
        aside = ACROSS.fullmatch(str(kinds["thing"]))
        if aside and other and _id_of(aside[1], False, standing) in standing.targets:
            return replace(chunk, kinds={"opposite": ""})
        name = _id_of(str(kinds["thing"]), other, standing)
        if name.startswith("?") and len(standing.pointed) == 1 and _is_shown(chunk, text):
            name = standing.pointed[0]
        kinds["thing"] = name
        if name in standing.targets:
            kinds["current"] = name
            if len(standing.groups) < 2:
                del kinds["thing"]
    return replace(chunk, kinds=kinds)


def known(phrase: str, standing: Standing) -> str:
    """Return the id of the known thing that words mean, or "?" and the words if there is none."""
    return _id_of(phrase, False, replace(standing, contract={"groups": []}))


def stood_about(things: Sequence[str], standing: Standing) -> list[str]:
    """Return ids of the things named, [] if one is not known; the first group's without names."""
    if not things:
        return list(standing.groups[0].get("targets", ()))
    names = [known(re.sub(r"^(?:the|this|that) ", "", words), standing) for words in things]
    return [] if any(name.startswith("?") for name in names) else names


def _is_shown(chunk: Chunk, text: str) -> bool:
    """Return whether a phrase means what is pointed at: "this house", "the house over here"."""
    first, *rest = text[chunk.start : chunk.end].lower().split()
    known = all(thing_phrase([word], 0) is not None for word in rest)
    shown = first in ("this", "that") and known
    return shown or bool(re.match(r" (?:(?:over|up|down|right) )?here\b", text[chunk.end :]))


def _id_of(phrase: str, other: bool, standing: Standing) -> str:
    """Return the id of a known thing, or "?" and the words if it has to be found."""
    if re.fullmatch(r"[tc][0-9]+", phrase):
        return phrase if phrase[0] == "t" else f"?{phrase}"
    words = set(re.findall(r"[a-z]+", phrase)) - {"one", "the", "thing", "object", "of", "two"}
    places = [int(place) - 1 for w, place in table()["ordinals"].items() if w in words]
    rest = words - set(table()["ordinals"])
    unnamed = all(label.startswith(UNNAMED) for _, label in standing.things)
    known = unnamed or all(thing_phrase([word], 0) is not None for word in rest)
    if len(places) == 1 and len(standing.things) > places[0] and known:
        return standing.things[places[0]][0]  # "the first coin": in their order
    if other and known and len(standing.others()) == 1 and standing.targets:
        return standing.others()[0]
    sides = {w: side for w in words if (side := SIDE_OF.get(str(SIDES.get(w, w))))}
    side, rest = next(iter(sides.values()), ""), words - set(sides)
    named = [t for t, label in standing.things if rest <= {*re.findall(r"[a-z]+", label.lower())}]
    if not named and unnamed:
        named = [t for t, _ in standing.things] if side else []
    placed = {t: at for t, at in (standing.centre or {}).items() if t in named}
    if side and len(placed) > 1:
        x, sign = int(side in ("top", "bottom")), -1 if side in ("left", "top") else 1
        named = [max(placed, key=lambda t: sign * placed[t][x])]
    elif side:
        named = []
    named = [t for t in named if words and not ((other or side) and t in standing.targets)]
    if len(named) == 1:
        return named[0]
    return f"?other {phrase}" if other else f"?{phrase}"


def impossible(chunks: Sequence[Chunk], standing: Standing) -> str:
    """Return why a named thing or length cannot be used, and what can be said; "" if all can."""
    there = [int(r) for r in standing.robots if r.isdecimal()]
    known = {*(t for t, _ in standing.things), *standing.pointed, *standing.targets}
    for chunk in chunks:
        strange = [r for r in chunk.kinds.get("robots", ()) if r not in there]
        name = str(chunk.kinds.get("thing", ""))
        if strange:
            return f"There is no robot {strange[0]}: there are {_span(there)}. Name one of those."
        if "m" in chunk.kinds:
            return unscaled(chunk.kinds["m"])
        if name.startswith("t") and name not in known:
            there_are = f"known are {listed(sorted(known))}"
            return f"There is no {name}: {there_are}. Point at it, or name it in words."
    return ""


def _span(there: Sequence[int]) -> str:
    whole = len(there) > 1 and there[-1] - there[0] + 1 == len(there)
    return f"robots {there[0]} to {there[-1]}" if whole else f"robots {listed(there)}"
