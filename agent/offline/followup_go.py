"""Whether words that have "go" in them surely tell the robots to move.

Robots that stay put cost a turn; robots that move when nobody said so cost trust, so that sayings
such as "here you go", and questions, are asked about.
"""

import re
from dataclasses import replace

from .followup import Followup

SAYINGS = re.compile(
    r"\b(?:here|there|where|how|as|so) (?:you|we|it|they|i|he|she|that|this|things?) go(?:es)?\b"
    r"|\b(?:way|good|nice|about|have|has|had|got|gotta|want|wants|time|place|nowhere) to go\b"
    r"|\bgo(?:es)? (?:figure|wrong|well|badly|bad|crazy|nuts)\b"
    r"|\blet(?: it| that| this)? go\b|\bno-go\b"
    r"|\b(?:no|not|never|none|nothing|nobody|without|touch and|as you|before|after|unless|until|if|"
    r"when|whether|don'?t|won'?t|can'?t|cannot) (?:\w+ )?go\b",
    re.IGNORECASE,
)
"""What people say with "go" in it that sends nobody anywhere."""
ASKED = re.compile(r"\?\W*$")
POLITE = re.compile(
    r"^\W*(?:(?:ok|okay|please|so|now|then)\W+)*(?:can|could|would|will) (?:you|we|they)\b"
    r"|\bplease\b",
    re.IGNORECASE,
)
"""A question that is an order."""


def with_sure_go(words: str, meant: Followup) -> Followup:
    """Return what is meant, or the question whether robots are to move where that is not sure."""
    if not (meant.go or meant.kind == "go"):
        return meant
    asked = ASKED.search(words) and not POLITE.search(words)
    if not asked and SAYINGS.search(words) is None:
        return meant
    if meant.kind == "instruction":
        return replace(meant, go=False)
    question = f'Are the robots to move now? "{words}" may not say so.'
    return Followup("ask", text=question, options=("go",))
