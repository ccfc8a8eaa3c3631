"""References to robots that the last change named: "those two" or "them".

"Those two" is replaced by their numbers; "them" may also be the whole team, so a question is asked.
"""

import re
from collections.abc import Callable, Mapping
from typing import Any, cast

from ...tools.formation.number_words import SMALL
from .followup import Followup
from .followup_edits import listed
from .followup_places import AMOUNTS
from .standing import Standing

BOT = r"(?:robots|bots|drones|rovers|units|machines|ones)"
N = "|".join(AMOUNTS)
AFTER = (
    r"(?=\W*$|[,;.!?]| (?:an?|to|up|down|left|right|further|farther|closer|nearer|out|in|inwards?|"
    r"outwards?|back|by|should|must|may|need|have|are|can|go|move|face|facing|turn|stay|stays|leave|"
    r"swap|trade|more|away|over|again|too|also|now|please|and|towards?|some|slightly|[0-9]+)\b)"
)
THOSE = re.compile(
    rf"\b(?:(?:both|all) (?:of )?)?(?:those|these|the same)(?: (?P<n>{N}))?(?: {BOT})?{AFTER}"
    rf"|\bthe (?P<m>{N}) of them{AFTER}|\bboth(?: of them| (?:of the )?{BOT}){AFTER}",
    re.IGNORECASE,
)
ALL_OF_SO_MANY = re.compile(
    rf"\ball (?:of )?(?:the )?([0-9]+|{'|'.join(SMALL)})\b(?: of (?:you|them|us))?"
    r"(?: (?:robots|bots|units))?(?! (?:sides?|corners?|things?|coins?|cars?|px|more|m\b))",
    re.IGNORECASE,
)
"""All robots, with their number: "all four", "all 8 of you"."""
THEM = re.compile(r"\b(?:them|they)\b", re.IGNORECASE)
ALL = re.compile(r"\b(?:all|every\w*|whole|team|ring|circle|row|formation)\b", re.IGNORECASE)


def recent_robots(standing: Standing) -> list[int]:
    """Return the robots of the last change if each of its edits names some; else none."""
    named = [_named_in(edit) for edit in standing.edits]
    robots = {r for row in named for r in row if str(r) in standing.robots}
    return sorted(robots) if all(named) and len(robots) > 1 else []


def _named_in(edit: Mapping[str, Any]) -> list[int]:
    """Return the robots that an edit names; `robots` may also be just a count."""
    several: object = edit.get("robots")
    row = cast("list[int]", several) if isinstance(several, list) else []
    return [*row, *(edit[key] for key in ("robot", "a", "b") if key in edit)]


def _all_if(match: re.Match[str], count: int) -> str:
    """Return "all of them" for "all four" where there are four robots, else the words."""
    said = match[1].lower()
    number = int(said) if said.isdecimal() else SMALL.get(said)
    return "all of them" if number == count else match[0]


def with_numbers(words: str, standing: Standing) -> str:
    """Return the words with "those two" replaced by the robots' numbers."""
    robots = recent_robots(standing)
    words = ALL_OF_SO_MANY.sub(lambda m: _all_if(m, len(standing.robots)), words)

    def numbers(match: re.Match[str]) -> str:
        said = next((n for n in match.groupdict().values() if n), None)
        count = 2 if match[0].lower().startswith("both") else AMOUNTS.get((said or "").lower())
        return match[0] if count not in (None, len(robots)) else f"robots {listed(robots)}"

    return THOSE.sub(numbers, words) if robots else words


def all_or_those(
    words: str, meant: Followup, standing: Standing, read: Callable[[str], Followup]
) -> Followup:
    """Return what is meant, or the question whether "them" is all robots or those just moved.

    Args:
        read: reads words; the question is only asked if it reads both options as edits.
    """
    robots, named = recent_robots(standing), THEM.search(words)
    whole = [e for e in meant.edits if "robot" not in e and "robots" not in e]
    if not robots or not named or not whole or ALL.search(words):
        return meant
    each = (f"robots {listed(robots)}", "all robots")
    options = tuple(THEM.sub(who, words, count=1) for who in each)
    if any(read(option).kind != "edits" for option in options):
        return meant
    text = f'Who is "{named[0]}" in "{words}": {each[0]}, which were moved last, or {each[1]}?'
    return Followup("ask", text=text, options=options)
