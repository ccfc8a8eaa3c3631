"""A first instruction about several things: as many robots at each, or a number for each thing.

Its words about all robots are read like those of an instruction about one thing.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from ...tools.formation.number_words import SMALL
from ..first_message import Task
from ..messages import History
from .accounting import read_instruction
from .choosing import Step, find, prompts_of
from .drafting import contract_of, question_of
from .pointed import narrowed
from .references import described

AT = r"a?round|about|at|inside|in|on|by|near|to|over|within"
EACH = re.compile(
    r"(?P<shared>,? ?\b(?:half|evenly|equally|split|shared|divided|as many)\b"
    r"[a-z ]*? )?"
    rf"\b(?P<at>{AT}) (?:each|every)\b(?! (?:of (?:its|the) )?(?:side|end|edge|flank|way))"
    r"(?: (?:one|single|thing|object|of (?:them|these|those|(?:the|these|those) [a-z]+)))*"
    r"(?: (?!(?:and|at|with|all|in|on|to|from|please|facing|then|but|of)\b)[a-z]+)?(?! ?corners?)",
    re.IGNORECASE,
)
"""Words by which each of several things is meant: "half round each", "inside each court"."""
NUMBER = rf"[0-9]{{1,5}}|{'|'.join(sorted(SMALL, key=len, reverse=True))}"
ROBOTS = r"(?:robots?|bots?|drones?|rovers?|units?|machines?|agents?)"
SHARE = re.compile(
    rf"(?:another |the other |other |the )?\b(?P<share>{NUMBER}|half|rest|others|"
    rf"remaining(?: {NUMBER})?|as many|same number)\b(?: more)?"
    rf"(?: of (?:them|those|the {ROBOTS}))?(?: {ROBOTS})?,?"
    rf"(?: (?:should |must |to )?(?:go|stand|stay|be|get|goes)\b)? "
    rf"(?P<at>(?:to )?(?:surround|encircl|guard)(?:e|ing)?|{AT}) "
    r"(?P<thing>(?:(?:the|this|that|these|a|an|my|our) )?[^,;.]+?)"
    r"(?=\s*(?:[,;.!]|\b(?:and|but|plus|then|while|please|with|at least|facing|evenly|each)\b|$))",
    re.IGNORECASE,
)
"""A share of the robots and where it goes: "half around the big coin", "2 at the other"."""
BETWEEN = re.compile(r"[\s,;.]*(?:(?:and|plus|then|while|but)\b[\s,]*)*", re.IGNORECASE)
OTHER = re.compile(r"(?:the )?other(?: one| thing)?", re.IGNORECASE)
BESIDE = re.compile(r"(?:on|at|to|in|by) (?:the |its )?(?:left|right|top|bottom)\b", re.IGNORECASE)
SIDE = re.compile(r"(?:the )?(?:left|right|top|bottom|upper|lower|middle)", re.IGNORECASE)
SHARES = {"half": 2}
WITH = re.compile(
    rf"\b(?:surround|encircle|circle|ring|guard) (?P<a>[^,;.]+?) with (?P<n>{NUMBER})(?: {ROBOTS})?"
    rf",? and (?P<b>[^,;.]+?) with (?P<m>{NUMBER})(?: {ROBOTS})?\b",
    re.IGNORECASE,
)
"""The shares of "surround t1 with 5 robots and t2 with 4"."""
AFTER = re.compile(
    rf"\b(?P<at>{AT}) (?P<thing>(?:the|this|that|my) [a-z ]+?|t[0-9]+),? "
    rf"(?!one\b)(?P<n>{NUMBER})(?: {ROBOTS})?"
    r"(?=\s*(?:[,;.]|and\b|$))",
    re.IGNORECASE,
)
"""A share named after its thing: "at the big coin 6 robots"."""
BARE = re.compile(rf"\b({NUMBER}) (?=t[0-9]+\b)", re.IGNORECASE)
"""A share for a thing that is named by its id: "6 t1, 6 t2"."""
SPLITTING = re.compile(r"\b(?:split|divide|share)\b(?: them| the team)?(?: up)?", re.IGNORECASE)
OTHERS = re.compile(rf"\b(?:{NUMBER}) (?!{ROBOTS}|of\b)[a-z]+s\b", re.IGNORECASE)
"""A number of things, not of robots: "there are two coins"."""


def about_several(task: Task, robots: int | None, history: History) -> Step | None:
    """Return the step for several things; None where the words are about one.

    Args:
        robots: how many, if that was given apart from the words.
    """
    if task.standing:
        return None
    task = replace(task, instruction=_plain(task.instruction))
    return _about_each(task, robots) or _in_shares(task, robots, history)


def _plain(text: str) -> str:
    """Return the words with their shares rewritten so that SHARE matches them."""
    text = WITH.sub(r"\g<n> robots around \g<a> and \g<m> around \g<b>", text)
    for pattern, put in ((AFTER, r"\g<n> robots \g<at> \g<thing>"), (BARE, r"\1 around ")):
        text = pattern.sub(put, text) if len(pattern.findall(text)) > 1 else text
    return text


def shares(text: str) -> list[re.Match[str]]:
    """Return the matches that say how many robots go to which of several things."""
    found = list(SHARE.finditer(_plain(text)))
    if any(BESIDE.match(f"{m['at']} {m['thing']}") for m in found):
        return []  # these are two sides of one thing
    links = [a.string[a.end() : b.start()] for a, b in pairwise(found)]
    alike = {m["at"].lower().removeprefix("a") for m in found}
    fits = len(found) > 1 and len(alike) == 1 and all(BETWEEN.fullmatch(link) for link in links)
    return found if fits else []


def _ids(task: Task) -> list[str]:
    return list(dict.fromkeys([*task.targets, *(p["id"] for p in task.pointed)]))


def _about_each(task: Task, robots: int | None) -> Step | None:
    """Propose as many robots about each of several pointed things; None if it is not about each."""
    each, ids = EACH.search(task.instruction), _ids(task)
    if each is None or len(ids) < 2:
        return None
    at = task.instruction[: each.start()], task.instruction[each.end() :]
    one = f"{at[0]} {each['at']} it{at[1]}"
    robots = robots or read_instruction(one, task.metres_per_pixel).robots
    whole, rest = divmod(robots or 0, len(ids)) if each["shared"] else (robots or 0, 0)
    if robots and whole < 1:
        few = f"{robots} robots are too few for {len(ids)} things. How many robots?"
        return Step("ask_user", {"question": few})
    counts = [whole + (k < rest) for k in range(len(ids))]
    return _proposed(task, one, robots, dict(zip(ids, counts, strict=True)), task.pointed)


def _in_shares(task: Task, robots: int | None, history: History) -> Step | None:
    """Propose the number of robots stated for each of several things; None if there are none."""
    text, found = task.instruction, shares(task.instruction)
    if not found:
        return None
    before, after = SPLITTING.sub("", text[: found[0].start()]), text[found[-1].end() :]
    about = OTHERS.sub("", f"{before} around it{after}")
    stated = robots or read_instruction(about, task.metres_per_pixel).robots
    counts = _counts([m["share"].lower() for m in found], stated)
    total = sum(counts)
    if not total or 0 in counts:
        return Step("ask_user", {"question": "How many robots go where? Say a number for each."})
    if stated not in (None, total):
        named = " and ".join(map(str, counts))
        question = f"{stated} robots were named, and {named} of them. How many go where?"
        return Step("ask_user", {"question": question})
    meant = _things(task, [m["thing"] for m in found], history)
    if meant is None or isinstance(meant, Step):
        return meant
    ids, prompts = meant
    before = re.sub(r"^\W*[0-9]+\W*$", "", before)  # the total, stated by itself
    one = f"{before}{total} robots {found[0]['at']} it{after}"
    return _proposed(task, one, total, dict(zip(ids, counts, strict=True)), prompts)


def _counts(shares: Sequence[str], total: int | None) -> list[int]:
    """Return the number of robots of each share; 0 where that is not known."""
    counts: list[int] = []
    for share in shares:
        word = share.removeprefix("remaining ")
        if share in ("as many", "same number"):
            counts.append(counts[-1] if counts else 0)
        elif share == "half" and counts and total is not None:
            counts.append(total - sum(counts))
        elif share in SHARES:
            counts.append(((total or 0) + 1) // SHARES[share])
        elif word in ("rest", "others", "remaining"):
            counts.append(max((total or 0) - sum(counts), 0))
        else:
            counts.append(int(word) if word.isdecimal() else SMALL[word])
    return counts


def _things(
    task: Task, phrases: Sequence[str], history: History
) -> tuple[list[str], Sequence[dict[str, Any]]] | Step | None:
    """Return the ids and target prompts of the things named, a call needed first, or None."""
    ids = _ids(task)
    if not ids:
        found = find(described(phrases), len(phrases), history)
        if isinstance(found, Step):
            return found
        prompts = prompts_of([(f.candidate, f.wording.split(" ", 1)[-1]) for f in found], ())
        return [p["id"] for p in prompts], prompts
    meant: list[str] = []
    for phrase in phrases:
        left = [name for name in ids if name not in meant]
        phrase = f"{phrase} one" if SIDE.fullmatch(phrase) else phrase
        chosen = narrowed(replace(task, instruction=f"around {phrase}"), history)
        if isinstance(chosen, Step):
            return chosen
        named = [str(p["id"]) for p in chosen.pointed]
        named = left if OTHER.fullmatch(phrase) or len(named) > 1 else named
        if len(named) != 1 or named[0] in meant:
            return None
        meant += named
    return meant, [p for p in task.pointed if p["id"] in meant]


def _proposed(
    task: Task,
    one: str,
    robots: int | None,
    counts: dict[str, int],
    prompts: Sequence[dict[str, Any]],
) -> Step:
    """Return the proposal of groups that are alike, or the question that has to come first."""
    reading = read_instruction(one, task.metres_per_pixel)
    alone = replace(task, instruction=one, pointed=task.pointed[:1], targets=())
    question = question_of(alone, reading, robots)
    if question or robots is None:
        return Step("ask_user", {"question": question or "How many robots?"})
    group = contract_of(reading, robots, [], [])["groups"][0]
    groups = [group | {"targets": [t], "robots": n} for t, n in counts.items()]
    unit = {} if task.metres_per_pixel is None else {"unit": "px"}
    contract = {"groups": groups, **unit}
    return Step("propose_formation", {"contract": contract, "targets": list(prompts)})
