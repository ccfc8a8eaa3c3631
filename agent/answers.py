"""A person's plain yes, which makes a doubtful outline the one meant, for every model alike."""

import re

YES = re.compile(
    r"(?:(?:y|yes|yep|yeah|ok|okay|sure|right|correct|exactly|please)[ ,.!]*)+"
    r"(?:(?:it|that)(?:'s| is| looks)? ?(?:right|correct|good|fine|it)?|use (?:it|that))?[ .!]*",
    re.IGNORECASE,
)


def says_yes(answer: str) -> bool:
    """Whether an answer is a yes and nothing else: "yes", "ok, that's it", no "the right one"."""
    return YES.fullmatch(answer.strip()) is not None
