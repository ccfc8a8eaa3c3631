"""Whether the words of a follow-up say who is meant where an edit would move all robots."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

ALL = re.compile(
    r"\b(?:all|everyone|everybody|every|they|them|robots|team|others?|rest|remaining|you"
    r"|the (?:ring|row|line))\b",
    re.IGNORECASE,
)
ONE = re.compile(
    r"(?<!not )\b(?:(?:this|that) (?:one|robot|guy|fellow)\b(?! too| as well| also)|he|she)\b",
    re.IGNORECASE,
)
"""Words for a single robot that nothing but a gesture or the talk before names."""
NAMED = frozenset(("robot", "robots", "a", "b"))
OF_ALL = frozenset(("target", "shift", "arrange", "side", "rotate", "out", "in", "scale"))
"""Kinds of edits that move all robots of a team where they name none."""


def unclear_subject(words: str, edits: Sequence[Mapping[str, Any]], *, pointed: bool) -> str:
    """Return what to ask where a clause may be about one robot or about all; "" if it is clear.

    Args:
        words: of the whole line.
        edits: that the line was read as.
        pointed: whether something is pointed at.
    """
    of_all = [e for e in edits if e["kind"] in OF_ALL and not NAMED & {*e}]
    if not of_all:
        return ""
    if ONE.search(words) and not pointed:
        return f'Which robot is meant in "{words}"? Name it by its number.'
    grouped = [k for k, e in enumerate(edits) if "group" in e]
    alike = [e for e in edits[grouped[0] + 1 :] if "group" not in e] if grouped else []
    if {e["kind"] for e in alike} & {*OF_ALL, "distance", "spacing"} and not ALL.search(words):
        return f'Which team is meant in all of "{words}"? Say it of one, or of all.'
    placed = [k for k, e in enumerate(edits) if e["kind"] == "place"]
    after = placed and edits[-1] in of_all and len(edits) > placed[-1] + 1
    if after and ALL.search(words) is None:
        return f'Who is meant in "{words}", all robots or robot {edits[placed[-1]]["robot"]} alone?'
    return ""
