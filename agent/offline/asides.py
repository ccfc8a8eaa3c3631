"""Small talk and reasons around a command: parts of a line that state something, demand nothing.

They are removed only where the rest is understood without them, and are quoted to the person.
"""

import re

from .followup_words import chunks_of, word_set
from .standing import Standing

PART = re.compile(r"[^.,;:!?]+[.,;:!?]*\s*|[.,;:!?]+\s*")
LEADS = r"(?:(?:actually|well|oh|so|and|but|hm+|now|ah|yes|no|ok|okay|sorry|right|hey|just)\s+)*"
VERBS = (
    r"(?:is|are|was|were|will|has|have|had|says|said|wants?|likes?|needs?|gets?|got|comes?|goes|"
    r"can'?t|can|cannot|could|might|must|may|just|looks?|seems?|feels?|stands?)"
)
PURPOSE = (
    r"because|since|otherwise|in case|as (?:i|we|it|they|my|the|there|our|someone)|cause|cos|"
    r"for (?:my|our) |so (?:that )?(?:the|my|our|we|i|they|it|someone|people|everyone|you) \w+|"
    r"(?:wide|big|large|far) enough (?:for|to|that)|like (?:in|at|before)"
)
"""Beginning of a reason or a purpose."""
TELLING = re.compile(
    rf"^\W*{LEADS}(?:that'?s|that (?:is|was|looks|seems)|it'?s|it (?:is|was|has|looks|seems|will)|"
    r"(?:that|it|this)(?:'?ll| will| would| might| could| makes?| feels?)|"
    r"this (?:is|looks|seems)|(?:these|those|they|there) (?:are|were|look|seem)|there'?s|there is|"
    r"i am|i'?m|i (?:feel|fear|see|have|had|hope|think|guess|know|was|like|love|forgot|suppose)|"
    r"i(?: do| really| just)* (?:thought|admit|wonder|worry|bet|appreciate|enjoy|realise|realize)|"
    r"you(?:'re| are|'ve| have| did| were)|(?:he|she|people|someone|everybody|everyone) "
    rf"{VERBS}|what an?|how (?:nice|lovely|kind)|no (?:rush|hurry|offence|pressure)|"
    r"i'?ve|i'?d (?:say|forgotten)|we (?:are|have|had|were)|we'?re|we'?ve|"
    rf"my|{PURPOSE}|never ?mind|isn'?t|aren'?t|don'?t worry|no worries|no problem|take your time|"
    rf"(?:the|our|his|her|this|that|some|an?) (?:\w+ ){{1,3}}{VERBS})\b",
    re.IGNORECASE,
)
"""Beginning of a part that states something."""
TELLS_OF = re.compile(
    rf"^\W*{LEADS}(?:there(?:'?s| is| are)|"
    r"(?:the|our|my|a) (?:\w+ ){1,2}(?:is|are|was|were|has|needs?)) "
    r"(?!.*\b(?:better|best|nicer|meant|instead|rather|fine|it)\b)",
    re.IGNORECASE,
)
"""Beginning of a statement about a thing that, named alone, would be the one to go to."""
WRONG = r"(?:close|near|far|tight|wide|big|small|large|crowded|cramped|dense|sparse|loose|many|few)"
COMPLAINT = re.compile(
    r"\b(?:(?:that|it|this|they|these|those)(?:'?s| is| are|'?re| looks?| seems?)) (?:(?:\w+ )?"
    rf"(?:a bit|a little|too|rather|quite|very|so|pretty|awfully|way too) {WRONG}\b(?! and\b)|"
    r"(?:\w+er|more|less) than (?:i|we|planned|expected|needed|necessary)\b)|"
    r"\b(?:is|are) (?:overkill|plenty|excessive|(?:way |far |a bit )?too (?:many|few|much))\b",
    re.IGNORECASE,
)
"""A complaint about how things are; another part says how they should be."""
ORDER = (
    r"(?:(?:so |then )?(?:can|could|would|will) (?:you|we|they)\b|please\b|let'?s\b|"
    r"(?:so |then )?"
    r"(?:make|move|put|turn|take|bring|pull|push|give|add|spread|use|leave|open|close) "
    r"(?:it|them|all|every\w+|the|an?|another|one|two|three|robots?|[0-9]+)\b)"
)
"""Beginning of a command that no punctuation sets off."""
REASON = re.compile(rf"(?<=[a-z0-9])\s+(?=(?:{PURPOSE}|but)\b)", re.IGNORECASE)
RUN_ON = re.compile(rf"(?<=[a-z])\s+(?={ORDER})", re.IGNORECASE)
IDLE = re.compile(
    r"^\W*(?:wide|big|large|far) enough\b|\bin (?:the|a) (?:way|(?:wrong|bad|odd) \w+)\b|"
    r"\bout of (?:place|line)\b|\blooks?\b(?! (?:at|toward|away|in|out|left|right|up|down))",
    re.IGNORECASE,
)
"""Words that demand nothing in a statement, but would in a command."""
OF_ONE = re.compile(rf"^\W*{LEADS}.*\b(?:is|stands|looks|seems|sits|was)\b", re.IGNORECASE)
"""Beginning of a statement about a robot that the command then calls "it"."""
WHY = re.compile(rf"\W*(?:{PURPOSE})\b", re.IGNORECASE)
IT = re.compile(r"\b(?:it|him|her|that one)\b", re.IGNORECASE)
WEIGHTY = frozenset(("robots", "px", "m", "angle", "share", "point", "neg", "never"))
"""Kinds of phrases that never occur in a complaint."""
DEMANDING = word_set("demanding")
"""Kinds of phrases that demand something, or change a demand."""


def without_asides(words: str, standing: Standing) -> tuple[str, tuple[str, ...]]:
    """Return the words without the parts that only state something, and those parts."""
    parts = [p for part in PART.findall(REASON.sub(", ", words)) for p in _run_on(part)]
    told = [k for k, part in enumerate(parts) if _only_states(part, standing)]
    kept = "".join(part for k, part in enumerate(parts) if k not in told)
    if parts and not told and OF_ONE.match(parts[0]) and IT.search(kept[len(parts[0]) :]):
        plain = IDLE.sub("", parts[0])
        one = [c for c in chunks_of(plain, standing) if {*c.kinds} & DEMANDING]
        if len(one) == 1 and "robots" in one[0].kinds:  # "robot 2 looks odd, move it up"
            name = plain[one[0].start : one[0].end]
            told, kept = [0], IT.sub(name, kept[len(parts[0]) :], count=1)
    return kept, tuple(parts[k].strip(" ,.;:!?") for k in told)


def _run_on(part: str) -> list[str]:
    """Split a part that states something and runs on to a command: "that's too far bring it in"."""
    after = RUN_ON.search(part) if COMPLAINT.search(part) or TELLING.search(part) else None
    return [part[: after.start()] + ", ", part[after.end() :]] if after else [part]


def _only_states(part: str, standing: Standing) -> bool:
    """Return whether a part states something and demands nothing."""
    found = chunks_of(IDLE.sub("", part), standing)
    kinds = {kind for chunk in found for kind in chunk.kinds}
    asks = part.rstrip().endswith("?") and not WHY.match(part)
    if COMPLAINT.search(part):
        counts = [c.kinds["num"] for c in found if "num" in c.kinds]
        return not asks and not kinds & WEIGHTY and counts in ([], [len(standing.robots)])
    return TELLING.search(part) is not None and not asks and not kinds & DEMANDING
