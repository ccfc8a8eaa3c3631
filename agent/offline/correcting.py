"""Words that correct one part of the line before: "20 px then", "with robot 7", "i meant 30".

The part takes the place of the one like it, and the whole is read again. What the line before
changed is taken back first, if the words say that they correct it.
"""

import re
from collections.abc import Sequence
from dataclasses import replace

from .clauses import Line
from .followup import Followup
from .followup_chunks import Chunk
from .followups import read_followup
from .standing import Standing

FAMILIES = (
    frozenset(("px", "m", "angle", "num")),
    frozenset(("thing", "current")),
    frozenset(("robots",)),
    frozenset(("side", "dir")),
)
"""Kinds of phrases that can stand for one another."""
IDLE = frozenset(("filler", "make", "leavegap", "it", "inward", "correction", "only", "polite"))
MARKED = re.compile(
    r"\b(?:i mean|i meant|meant|sorry|no|not|rather|instead|make (?:that|it)|oops|actually|wait)\b",
    re.IGNORECASE,
)
"""Words that say that the line before is corrected."""
LED_BY = frozenset(("with", "around", "round", "to", "towards", "at", "from", "by", "on"))
RANKED = re.compile(
    r"\W*(?:(?:i mean|i meant|no|ok|sorry)\W+)*the (?P<rank>first|former|second|latter|last)"
    r"(?: one| of them| of those)?(?: then| please)*\W*",
    re.IGNORECASE,
)


def corrected(followup: Followup, words: str, standing: Standing | None) -> Followup:
    """Return the follow-up, or what the line before means with a part put right by these words.

    Args:
        followup: what the words mean by themselves.
        words: the person's.
        standing: the plan and what was said before.
    """
    said = standing.said if standing else ""
    if followup.kind != "ask" or standing is None or not said:
        return followup
    changed = said == standing.words
    if changed and not MARKED.search(words):
        return followup
    for text in amendments(words, said, standing):
        meant = read_followup(text, replace(standing, said=""))
        if meant.kind == "edits" and not (meant.undo or meant.to):
            return replace(meant, undo=1) if changed else meant
    return followup


def amendments(words: str, said: str, standing: Standing) -> tuple[str, ...]:
    """Return what a line may mean with one part put right by other words."""
    texts = (_one_of_two(words, said, standing), _amended(words, said, standing))
    return tuple(text for text in texts if text is not None)


def _amended(words: str, said: str, standing: Standing) -> str | None:
    """Return a line with the part replaced that words correct; None if they say anything else."""
    new, old = Line(words, standing), Line(said, standing)
    told = [c for c in new.chunks if c.kinds and not IDLE.issuperset(c.kinds)]
    if len(told) != 1:
        return None
    part = told[0]
    family = next((f for f in FAMILIES if not f.isdisjoint(part.kinds)), None)
    if family is None:
        return None
    place = _after_same_word(new, old, part) or _alike(old.chunks, family)
    if place is None or place == part:
        return None
    put = new.words[part.start : part.end]
    if "num" in part.kinds and "num" not in place.kinds:  # "i meant 30", of 20 px
        unit = re.sub(r"^[\d.,\s]+", " ", old.words[place.start : place.end])
        put += unit if unit.startswith(" ") else " px"
    return f"{old.words[: place.start]}{put}{old.words[place.end :]}"


def _alike(chunks: Sequence[Chunk], family: frozenset[str]) -> Chunk | None:
    """Return the one phrase of a family; None if there is none, or more than one."""
    found = [c for c in chunks if not family.isdisjoint(c.kinds)]
    return found[0] if len(found) == 1 else None


def _after_same_word(new: Line, old: Line, part: Chunk) -> Chunk | None:
    """Return the phrase that follows on the same word as the part does: "with itself"."""
    k = new.chunks.index(part)
    lead = new.words_of([new.chunks[k - 1]]).lower() if k else ""
    if lead not in LED_BY:
        return None
    after = [b for a, b in zip(old.chunks, old.chunks[1:], strict=False) if _says(old, a, lead)]
    return after[0] if len(after) == 1 else None


def _says(line: Line, chunk: Chunk, word: str) -> bool:
    return line.words_of([chunk]).lower() == word


def _one_of_two(words: str, said: str, standing: Standing) -> str | None:
    """Return the half of a contradictory line that "the first" or "the second" chooses."""
    ranked = RANKED.fullmatch(words)
    halves = re.split(r"\s+(?:and|or|but)\s+|\s*,\s*", said.strip(" .!?"))
    if ranked is None or len(halves) != 2:
        return None
    chosen = halves[0 if ranked["rank"].lower() in ("first", "former") else 1]
    whole = read_followup(said, replace(standing, said=""))
    return chosen if whole.kind in ("ask", "refuse") else None
