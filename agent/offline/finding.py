"""Finds things that a follow-up names, among what is measured or else in the picture."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..messages import History, Result
from .choosing import Found, Step, find, located, sightings
from .followup_edits import OTHER
from .phrases import table
from .references import described
from .standing import Standing

CLEARLY = 0.7
"""Least share of a colour that a thing meant by it has, relative to the one that has most."""


def known_thing(phrase: str, standing: Standing, messages: History) -> str | Step | None:
    """Return the known thing, not the plan's, that fits words, a call needed first, or None."""
    others = {t: at for t, at in (standing.centre or {}).items() if t in standing.others()}
    things = described([phrase])
    vague = len(things) != 1 or not things[0].noun or things[0].unknown or things[0].refused
    if not others or vague or phrase.startswith(("other ", OTHER[1:])):
        return None
    return one_at(things[0].whole_query, others, messages)


def one_at(
    query: dict[str, Any], centres: Mapping[str, Sequence[float]], messages: History
) -> str | Step | None:
    """Return the one of some known things that fits a query, a call to make first, or None."""
    reply = located(query or None, messages)
    if reply is None:
        return Step("locate_object", {"query": query} if query else {})
    shares: dict[str, float] = {}
    for candidate in reply["candidates"]:
        name = measured_at(candidate["id"], centres, messages)
        share = max((candidate["colours"].get(c, 0.0) for c in query.get("colours", ())), default=1)
        if name is not None:
            shares[name] = max(share, shares.get(name, 0.0))
    fitting = [name for name, share in shares.items() if share >= CLEARLY * max(shares.values())]
    return fitting[0] if len(fitting) == 1 else None


def found_thing(phrase: str, standing: Standing, messages: History) -> Found | Step:
    """Return the candidate that words for a thing mean, or the call that helps to find it."""
    if re.fullmatch(r"c[0-9]+", phrase):
        return Found(phrase, phrase, ())
    if f"?{phrase}" == OTHER or phrase.startswith("other "):
        return _other(phrase, standing, messages)
    found = find(described([phrase]), 1, messages)
    return found if isinstance(found, Step) else found[0]


def _other(phrase: str, standing: Standing, messages: History) -> Found | Step:
    """Return the one that is like the target, or of the noun named, but not a target itself."""
    label = next((label for name, label in standing.things if name in standing.targets), "")
    things = described(
        [phrase.removeprefix("other ") if f"?{phrase}" != OTHER else label or "thing"]
    )
    noun = things[0].noun if things else ""
    query = table()["nouns"].get(noun, {}).get("query")
    chosen = (
        find((), 1, messages)
        if any(m.name == "ask_user" for m in messages if isinstance(m, Result))
        else None
    )
    if isinstance(chosen, list):
        return chosen[0]
    reply = located(query, messages)
    if reply is None:
        return Step("locate_object", {"query": query} if query else {})
    mine = [
        standing.centre[t] for t in standing.targets if standing.centre and t in standing.centre
    ]
    others = [
        c for c in reply["candidates"] if not any(_holds(c["box"], centre) for centre in mine)
    ]
    if len(others) == 1:
        return Found(others[0]["id"], label or "other one", ())
    ids = [c["id"] for c in others]
    return Step(
        "ask_user",
        {"question": "Which one is the other one? Answer with its number.", "candidates": ids},
    )


def measured_at(
    candidate: str, centres: Mapping[str, Sequence[float]], messages: History
) -> str | None:
    """Return the id of a measured thing where a candidate lies; None where there is none."""
    boxes = [c["box"] for c in sightings([candidate], messages)]
    there = (t for t, at in centres.items() for box in boxes if _holds(box, (at[0], at[1])))
    return next(there, None)


def _holds(box: Sequence[float], point: tuple[float, float]) -> bool:
    return box[0] <= point[0] <= box[2] and box[1] <= point[1] <= box[3]
