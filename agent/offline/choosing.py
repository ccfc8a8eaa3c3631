"""Choice of the candidate that words mean: what to ask the tools, and when to ask the person.

A thing is taken only if measures single it out; otherwise the person chooses among numbered
candidates. Questions and answers are read from the history, so no state is stored here.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from textwrap import shorten
from typing import Any

from ...tools.perception.referring.query import SINGLE
from ..first_message import read_task
from ..messages import Call, History, Reply, Result, User
from .descriptions import Reference
from .options import AGREEING, NUMBERING, SMALL, numbered, option_chosen, picked
from .phrases import table
from .references import described

CROWDED, FAINT = 20, 0.6
"""With more things than this, or fainter ones, they are likelier patches than what people mean."""
MOST_ASKED = 24
"""Most candidates that one question offers: more cannot be told apart on a picture."""
MOST_QUOTED = 200
"""Most characters of an answer that a question quotes."""
CANDIDATE_ID = re.compile(r"c[0-9]+\b")
POINT = "point at it, with a point, a box or a rough outline"


@dataclass(frozen=True)
class Found:
    """The candidate that is meant, the words for it and the measured reasons."""

    candidate: str
    wording: str
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Step:
    """A tool call that has to come first."""

    name: str
    arguments: dict[str, Any]


def find(
    things: Sequence[Reference],
    needed: int,
    history: History,
    answers: list[str] | None = None,
) -> list[Found] | Step:
    """Return the candidates meant, as many as are needed, or the call that helps to find them.

    A question that is asked again says that the answer chose nothing.

    Args:
        answers: candidates that the person chose for these things or, after them, for others, in
            order; those used are removed. If left out, all chosen ones are for these things.
    """
    if answers is None:
        found = _find(things, needed, history, chosen_candidates(history, needed), sole=True)
    else:
        found = _find(things, needed, history, answers, sole=False)
    asked = [c for c in calls_in(history) if c.name == "ask_user" and c.arguments.get("candidates")]
    if isinstance(found, list) or found.name != "ask_user" or not asked:
        return found
    answered = next((k for k, m in enumerate(history) if _answers(m, asked[-1])), len(history))
    before, now = (chosen_candidates(h, len(asked)) for h in (history[:answered], history))
    if before != now:
        return found  # the last answer chose one, and this is about the next
    answer = "".join(m.text for m in history[answered : answered + 1])
    question = f"{_in_quotes(answer)} chooses none of them. {found.arguments['question']}"
    return Step(found.name, found.arguments | {"question": question})


def _find(
    things: Sequence[Reference], needed: int, history: History, chosen: list[str], *, sole: bool
) -> list[Found] | Step:
    if len(chosen) >= needed and (sole or len(things) < needed):
        label = things[0].wording if needed == len(things) == 1 else "the chosen thing"
        return [Found(chosen.pop(0), label, ()) for _ in range(needed)]
    if needed == 2 and len(things) == 1 and things[0].plural and not chosen:
        return _pair(things[0], history)
    if len(things) > needed:
        one = _alternative(things, needed, history)
        if isinstance(one, Step):
            return one
        things = [one]
    found: list[Found] = []
    for thing in things:
        one = _choose_one(thing, history)
        if isinstance(one, Step) and one.name == "ask_user" and chosen:
            one = Found(chosen.pop(0), thing.wording, ())  # the answer to that question
        if isinstance(one, Step):
            return one
        found.append(one)
    if len(found) == needed:
        return found
    if one := [*(f.candidate for f in found), *chosen]:
        return _ask_all(f"Which is the other thing, beside {one[0]}?", history)
    which = "Which thing is meant?" if needed == 1 else "Which two things are meant?"
    spoken = " or ".join(f'"{t.wording}"' for t in things)
    named = f"By {spoken} none can be found" if spoken else "The words name none that can be found"
    return _ask_all(f"{which} {named} by its look.", history)


def _alternative(things: Sequence[Reference], needed: int, history: History) -> Reference | Step:
    """Return the one of more things than are needed that is meant, or the question which it is.

    An answer may also describe another thing.
    """
    options, unclear = [t.wording for t in things], ""
    if needed > 1:
        named = ", ".join(f'"{wording}"' for wording in options)
        return _ask_all(f"Which two things is the arrangement about, of {named}?", history)
    for call in calls_in(history):
        if list(call.arguments.get("options", ())) == options:
            answer = next((m.text for m in history if _answers(m, call)), "")
            if (chosen := option_chosen(answer, options)) is not None:
                return things[options.index(chosen)]
            others = [t for t in described([answer]) if t.noun and t.query]
            others = [t for t in others if not (t.unknown or t.refused)]
            if len(others) == 1:
                return others[0]
            unclear = f"{_in_quotes(answer)} is none of them. " if answer else ""
    question = numbered(f"{unclear}Which thing is the arrangement about?", options)
    return Step("ask_user", {"question": question, "options": options})


def names_things(call: Call) -> bool:
    """Return whether a question's alternatives are words for things, as in `_alternative`."""
    options = call.arguments.get("options") or [""]
    return all(str(o).split(" ", 1)[0] in table()["determiners"] for o in options)


def _in_quotes(answer: str) -> str:
    return f'"{shorten(answer, MOST_QUOTED, placeholder=" ...")}"'


def chosen_candidates(history: History, needed: int) -> list[str]:
    """Return the candidates that the person chose among those offered, in order.

    An answer that names more than are needed, or says which one it is not, chooses nothing.
    """
    chosen: list[str] = []
    for call in calls_in(history):
        if call.name == "ask_user" and call.arguments.get("candidates"):
            answer = next((m.text for m in history if _answers(m, call)), "").lower()
            numbers = re.findall(r"(?<![-.\w])c?([0-9]{1,4})(?!\.?[0-9])\b", answer)
            rest = set(re.findall(r"[a-z']+", re.sub(r"\bc[0-9]+", " ", answer)))
            plain = rest <= SMALL | AGREEING | NUMBERING  # else the number may mean anything
            offered = [
                f"c{n}" for n in numbers if f"c{n}" in call.arguments["candidates"] and plain
            ]
            if not offered:
                offered = picked(answer, sightings(call.arguments["candidates"], history))
            named = list(dict.fromkeys([*chosen, *offered]))
            if len(named) <= needed and not _excludes(answer):
                chosen = named
    return chosen


def sightings(ids: Sequence[str], history: History) -> list[dict[str, Any]]:
    """Return what locate_object last said of candidates; ids that it never gave are left out."""
    found: dict[str, dict[str, Any]] = {}
    for message in history:
        if isinstance(message, Result) and message.name == "locate_object" and not message.error:
            found |= {c["id"]: c for c in json.loads(message.text).get("candidates", ())}
    return [found[i] for i in ids if i in found]


def _excludes(answer: str) -> bool:
    words = set(re.findall(r"[a-z']+", answer))
    return bool(words & {*table()["blockers"], *table()["differences"]["negation"]})


def _answers(message: User | Reply | Result, call: Call) -> bool:
    return isinstance(message, Result) and message.call_id == call.id


def _choose_one(thing: Reference, history: History) -> Found | Step:
    """Return the one candidate a description means, or the call that helps to find it."""
    named = thing.named_query if _nouns_are_found(history) else None
    trouble = _trouble(thing)
    if trouble and (named is None or thing.plural):
        return _ask_all(trouble, history)
    query = named or thing.whole_query
    reply = located(query, history)
    if reply is None:
        return Step("locate_object", {"query": query})
    matches = reply["candidates"]
    alone = reply["things"] == 1 or (
        matches and matches[0]["id"] == "c1" and _fits_most_salient(thing)
    )
    if reply["settled"] and (named or alone or not _says_little(thing, _is_clear(reply))):
        return Found(matches[0]["id"], thing.wording, tuple(matches[0].get("reasons", ())))
    if matches:
        why = reply["doubt"] or f"{_listed(matches)} may be meant"
        return _ask(f'Which one is "{thing.wording}"? {_sentence(why)}', matches)
    if reply["absent"] and query == thing.query and not thing.unknown:
        reason = f'"{thing.wording}" is not in the picture: {reply["lacking"]}.'
        return Step("report_impossible", {"reason": reason})
    why = reply["lacking"] or reply["doubt"]
    return _ask_all(f'Which one is "{thing.wording}"? {_sentence(why)}', history)


def _nouns_are_found(history: History) -> bool:
    """Return whether the turn's first message says that things can be found by their nouns."""
    first = next((m.text for m in history if isinstance(m, User)), None)
    return first is not None and read_task(first).nouns


def _pair(thing: Reference, history: History) -> list[Found] | Step:
    """Return the two things that a plural means, or the call that helps to find them."""
    query = {"count": 2} | thing.whole_query
    reply = located(query, history)
    if reply is None:
        return Step("locate_object", {"query": query})
    matches = reply["candidates"]
    if len(matches) == 2 and thing.noun and not thing.refused:
        return [Found(m["id"], thing.wording, tuple(m.get("reasons", ()))) for m in matches]
    return _ask_all(f'Which two are "{thing.wording}"?', history)


def _trouble(thing: Reference) -> str:
    """Return a question if measures cannot decide a description at all, else ""."""
    if thing.plural:
        return f'Which one of "{thing.wording}"? Robots are placed about one thing at a time.'
    if thing.refused or (not thing.noun and not thing.query):
        words = thing.refused or thing.wording
        return (
            f'Which one is "{thing.wording}"? The offline rules know things by colour, shape, size '
            f'and place only, and do not know "{words}".'
        )
    return ""


def _fits_most_salient(thing: Reference) -> bool:
    """Return whether the words fit the most salient thing for what it is, not for its rank.

    Unknown words suggest that there are several to tell apart; and if nothing measures the noun,
    the second from the left or the largest may be of another kind.
    """
    if not thing.query:
        return not thing.unknown and bool(thing.whole_query)
    ranks_alone = set(thing.query) == {"picks"} and _ranked(thing)
    return not (ranks_alone and thing.weak and thing.whole_query == thing.query)


def _ranked(thing: Reference) -> bool:
    return any(p["by"] not in SINGLE for p in thing.query.get("picks", ()))


def _is_clear(reply: dict[str, Any]) -> bool:
    """Return whether the match stands out in a picture that is not full of patches."""
    return reply["things"] <= CROWDED and reply["candidates"][0]["salience"] >= FAINT


def _says_little(thing: Reference, clear: bool) -> bool:
    """Return whether it takes a noun that cannot be measured, alone or for a rank among its kind.

    A rank among mugs is no rank among all things, and a picture full of patches settles no rank.
    Such a thing must be the only one, or fit the words and stand out most.
    """
    if thing.unknown and not thing.query:
        return True
    ranked = _ranked(thing)
    if thing.noun in ("any", ""):
        return not thing.query or (ranked and not clear)
    nouns = {name for name in thing.whole_query if name not in thing.query}
    unmeasured = thing.noun != "shape" and nouns <= {"colours", "shade"}  # not all blue is a pond
    loose = unmeasured or not clear
    return (thing.weak and not thing.query) or (loose and ranked)


def _ask(question: str, matches: Sequence[dict[str, Any]]) -> Step:
    ids = [m["id"] for m in matches[:MOST_ASKED]]
    hint = f"Answer with its number, such as {ids[0]}" if ids else POINT.capitalize()
    return Step("ask_user", {"question": f"{question} {hint}.", "candidates": ids})


def _ask_all(question: str, history: History) -> Step:
    """Ask the question, offering all that stands out in the picture, once it is located."""
    reply = located(None, history)
    if reply is None:
        return Step("locate_object", {})
    return _ask(question, reply["candidates"])


NOTHING_FOUND: dict[str, Any] = {
    "candidates": [],
    "things": 0,
    "settled": False,
    "absent": False,
    "doubt": "",
    "lacking": "",
}
"""An answer of locate_object that says nothing."""


def located(query: dict[str, Any] | None, history: History) -> dict[str, Any] | None:
    """Return what locate_object answered to a query; None if it was not called with it."""
    for call in calls_in(history):
        if call.name == "locate_object" and call.arguments.get("query") == query:
            result = next(m for m in history if isinstance(m, Result) and m.call_id == call.id)
            return NOTHING_FOUND | ({} if result.error else json.loads(result.text))
    return None


def located_reasons(history: History) -> dict[str, list[str]]:
    """Return why each candidate matched what was asked for, by id."""
    found: dict[str, list[str]] = {}
    for message in history:
        if isinstance(message, Result) and message.name == "locate_object" and not message.error:
            for candidate in json.loads(message.text).get("candidates", ()):
                found[candidate["id"]] = candidate.get("reasons", [])
    return found


def prompts_of(
    found: Sequence[tuple[str, str]], before: History, taken: Sequence[str] = ()
) -> list[dict[str, Any]]:
    """Return candidates and their labels as targets; those of earlier turns keep their ids.

    Args:
        found: pairs of candidate and label.
        before: messages of the earlier turns.
        taken: further ids that are in use.
    """
    calls = [c for m in before if isinstance(m, Reply) for c in m.calls]
    given: list[Any] = [t for c in calls for t in c.arguments.get("targets") or ()]
    earlier: list[dict[str, Any]] = [t for t in given if isinstance(t, dict) and "id" in t]
    known = {t["candidate"]: t["id"] for t in earlier if "candidate" in t}
    used = {*taken, *(t["id"] for t in earlier)}
    free = (name for i in count(1) if (name := f"t{i}") not in used)
    return [
        {"id": known.get(name) or next(free), "candidate": name, "label": label}
        for name, label in found
    ]


def calls_in(history: History) -> list[Call]:
    """Return all tool calls of a history, in order."""
    return [call for m in history if isinstance(m, Reply) for call in m.calls]


def _listed(matches: Sequence[dict[str, Any]]) -> str:
    return ", ".join(m["id"] for m in matches[:5])


def _sentence(text: str) -> str:
    named = CANDIDATE_ID.match(text)  # which is written as it is
    begin = text[:1] if named else text[:1].upper()
    return begin + text[1:].rstrip(".") + "." if text else ""


def candidate_notes(history: History) -> list[str]:
    """Return sentences on which candidates were taken for the things meant, and why."""
    last = next(c for c in calls_in(history)[::-1] if c.name == "propose_formation")
    reasons = located_reasons(history)
    return [
        f"Took {p['candidate']} for the {p.get('label') or 'thing chosen'}"
        + (f": {'; '.join(reasons[p['candidate']])}." if reasons.get(p["candidate"]) else ".")
        for p in last.arguments["targets"]
        if p.get("candidate")
    ]
