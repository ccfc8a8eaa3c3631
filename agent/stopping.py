"""Words that hold the robots at once, and the fleets that are held; no model is asked."""

import asyncio
import re
from collections.abc import Iterable

from ..tools.fleet.protocol import Fleet

STOP = re.compile(
    r"(?=.*\b(?:stop|halt|freeze)\b)"
    r"(?:\W*(?:stop|halt|freeze|please|now|it|the|robots?|all|them|every\w*|team|"
    r"immediately|at|once|emergency|right|just|quick|oh|no|hey|ok|moving|driving|this|that)\b)+\W*"
)
"""A sentence that holds the robots at once, before any model reads it."""
STOP_DRIVING = re.compile(r"\b(?:stop+|halt|freeze|hold|wait|abort|cancel|don'?t|whoa|enough)\b")
"""Words that hold driving robots if the sentence is short: one stop too many costs little."""
SHORT = 8
"""Most words of a short sentence."""


async def stop_all(fleets: Iterable[Fleet]) -> None:
    """Stop every fleet, even if another one fails to stop.

    Raises:
        FleetError: of the first fleet that could not be stopped.
    """
    ends = await asyncio.gather(*(fleet.stop() for fleet in fleets), return_exceptions=True)
    for problem in ends:
        if isinstance(problem, BaseException):
            raise problem


def is_stop(words: str, *, driving: bool = False) -> bool:
    """Return whether words say to hold the robots at once.

    Args:
        driving: whether a turn is under way that may be driving them.
    """
    said = words.lower()
    if driving:
        return len(said.split()) <= SHORT and STOP_DRIVING.search(said) is not None
    return STOP.fullmatch(said) is not None
