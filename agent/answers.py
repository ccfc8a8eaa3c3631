"""Recognises a person's plain yes, which confirms a doubtful outline whichever model decides."""

import re

YES = re.compile(
    r"(?:(?:y|yes|yep|yeah|ok|okay|sure|right|correct|exactly|please)[ ,.!]*)+"
    r"(?:(?:it|that)(?:'s| is| looks)? ?(?:right|correct|good|fine|it)?|use (?:it|that))?[ .!]*",
    re.IGNORECASE,
)


def says_yes(answer: str) -> bool:
    """Return whether an answer is just a yes, as "ok, that's it" is and "the right one" is not."""
    return YES.fullmatch(answer.strip()) is not None
