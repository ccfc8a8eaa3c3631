"""Small talk and reasons around a command: parts of a line that tell something and demand nothing.

They are taken out only where the rest is understood without them, and are quoted to the person.
"""

import re

from .followup_words import chunks_of, word_set
from .standing import Standing

PART = re.compile(r"[^.,;:!?]+[.,;:!?]*\s*|[.,;:!?]+\s*")
LEADS = r"(?:(?:actually|well|oh|so|and|but|hm+|now|ah|yes|no|ok|okay|sorry|right|hey|just)\s+)*"
TELLING = re.compile(
    rf"^\W*{LEADS}(?:that'?s|that (?:is|was|looks|seems)|it'?s|it (?:is|was|has|looks|seems|will)|"
    r"this (?:is|looks|seems)|(?:these|those|they|there) (?:are|were|look|seem)|there'?s|there is|"
    r"i am|i'?m|i (?:feel|fear|see|have|had|hope|think|guess|know|was|like|love|forgot|suppose)|"
    r"i'?ve|i'?d (?:say|forgotten)|we (?:are|have|had|were)|we'?re|we'?ve|"
    r"my|because|since|as (?:i|we|it|they|my|the|there)|cause|cos|for (?:my|our) |"
    r"never ?mind|isn'?t|aren'?t|don'?t worry|no worries|no problem|"
    r"(?:the|our|his|her) \w+ (?:is|are|was|were|will|has|have|had|says|said|wants?|"
    r"likes?|needs?|gets?|got|comes?|goes|can'?t|cannot|might|must|may|just))\b",
    re.IGNORECASE,
)
"""How a part begins that tells something."""
COMPLAINT = re.compile(
    r"\b(?:(?:that|it|this|they|these|those)(?:'?s| is| are|'?re| looks?| seems?)) (?:\w+ )?"
    r"(?:a bit|a little|too|rather|quite|very|so|pretty|awfully|way too) "
    r"(?:close|near|far|tight|wide|big|small|large|crowded|cramped|dense|sparse|loose|many|few)\b"
    r"(?! and\b)",
    re.IGNORECASE,
)
"""What is wrong; how it should be is said beside it."""
DEMANDING = word_set("demanding")
"""Kinds of phrases that demand something, or change what does."""


def without_asides(words: str, standing: Standing) -> tuple[str, tuple[str, ...]]:
    """The words without parts that only tell something, and those parts."""
    parts = PART.findall(words)
    told = [k for k, part in enumerate(parts) if _tells(part, standing)]
    kept = "".join(part for k, part in enumerate(parts) if k not in told)
    return kept, tuple(parts[k].strip(" ,.;:!?") for k in told)


def _tells(part: str, standing: Standing) -> bool:
    """Whether a part tells something and demands nothing."""
    if TELLING.search(part) is None or part.rstrip().endswith("?"):
        return False
    if COMPLAINT.search(part):
        return True
    return not any(DEMANDING & set(c.kinds) for c in chunks_of(part, standing))
