"""Resolves corrections and typing errors in an instruction to what is finally meant."""

import re

from ...tools.formation.number_words import SMALL
from .accounting import read_instruction
from .spelling import spelled

NUMBER = rf"(?:[0-9]{{1,5}}|{'|'.join(sorted(SMALL, key=len, reverse=True))})"
ROBOTS = r"(?:robots?|bots?|drones?|rovers?|units?|machines?|agents?|of them)"
TAKEN_BACK = (
    r"(?:oh |um |uh |er )?"
    r"(?:no,? wait|wait,? no|wait|no,? sorry|sorry,? no|sorry|no,? i mean|i mean|i meant|"
    r"no,? make (?:that|it)|make that|or rather|"
    r"rather|correction|oops|scratch that|hang on|actually,? no|no,? actually|actually|no)"
)
COUNT = re.compile(rf"\b(?P<count>{NUMBER}) (?:\w+ )?{ROBOTS}\b", re.IGNORECASE)
RECOUNT = re.compile(
    rf"[ ,.;:\u2013-]*\b(?:{TAKEN_BACK}[ ,.;:]+)+(?:make (?:that|it) )?"
    rf"(?:{NUMBER}[ ,.;]+)*?(?P<count>{NUMBER})(?: {ROBOTS})?(?: please)?"
    rf"(?=\W*$|[,.;](?! *{NUMBER}))",
    re.IGNORECASE,
)


def with_last_count(words: str) -> str:
    """Return the words with the robot count given last: "9 robots, no wait, ten robots"."""
    again = RECOUNT.search(words)
    first = COUNT.search(words)
    if again is None or first is None or again.start() < first.end():
        return words
    rest = words[: again.start()] + words[again.end() :]
    return rest[: first.start()] + again["count"] + rest[first.end("count") :]


def repaired(words: str) -> str:
    """Return an instruction with corrections applied, and typos fixed if it is understood then."""
    words = with_last_count(words)
    corrected = spelled(words)
    if corrected != words and read_instruction(words).unread:
        return words if read_instruction(corrected).unread else corrected
    return words
