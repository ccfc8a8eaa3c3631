"""Robots that were moved by name a moment ago, and are spoken of as "those two" or "them" now.

"Those two" is put into numbers; "them" may be all of the team as well, so which is asked.
"""

import re
from collections.abc import Callable, Mapping
from typing import Any, cast

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
THEM = re.compile(r"\b(?:them|they)\b", re.IGNORECASE)
ALL = re.compile(r"\b(?:all|every\w*|whole|team|ring|circle|row|formation)\b", re.IGNORECASE)


def recent_robots(standing: Standing) -> list[int]:
    """The robots that the last change was about, where it named several and nothing else."""
    named = [_named_in(edit) for edit in standing.edits]
    robots = {r for row in named for r in row if str(r) in standing.robots}
    return sorted(robots) if all(named) and len(robots) > 1 else []


def _named_in(edit: Mapping[str, Any]) -> list[int]:
    """The robots that an edit names; `robots` may be a mere number of them."""
    several: object = edit.get("robots")
    row = cast("list[int]", several) if isinstance(several, list) else []
    return [*row, *(edit[key] for key in ("robot", "a", "b") if key in edit)]


def with_numbers(words: str, standing: Standing) -> str:
    """The words with the numbers of robots for "those two"."""
    robots = recent_robots(standing)

    def numbers(match: re.Match[str]) -> str:
        said = next((n for n in match.groupdict().values() if n), None)
        count = 2 if match[0].lower().startswith("both") else AMOUNTS.get((said or "").lower())
        return match[0] if count not in (None, len(robots)) else f"robots {listed(robots)}"

    return THOSE.sub(numbers, words) if robots else words


def all_or_those(
    words: str, meant: Followup, standing: Standing, read: Callable[[str], Followup]
) -> Followup:
    """What is meant, or the question whether "them" is all robots or those moved just now.

    Args:
        read: reads words; what it does not understand is not offered.
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
