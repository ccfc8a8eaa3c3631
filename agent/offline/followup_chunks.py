"""The phrases of follow-ups, and which of their kinds they can be where they stand."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .standing import Standing

WHO = frozenset(("team", "robots", "portion", "rest", "vague", "lone"))


@dataclass(frozen=True)
class Chunk:
    """A phrase: its kinds, each with its value, and its start and end in characters.

    Kinds beside those of followups.yaml: robots (numbers), num, px, m, angle, share, point, thing
    (its words, or an id), team, it, filler, sep, correction, unknown.
    """

    kinds: Mapping[str, Any]
    start: int
    end: int


def in_context(chunks: Sequence[Chunk], standing: Standing) -> Iterator[Chunk]:
    """Drop kinds that a phrase cannot be where it stands.

    "All around" is not "about", and who waits corrects nothing; "both" are teams if there are two.
    """
    for k, chunk in enumerate(chunks):
        last = not chunks[k + 1 :] or not {"sep", "it"}.isdisjoint(chunks[k + 1].kinds)
        wrong = {"about"} if "relation" in chunk.kinds and last else set[str]()
        who = {*chunks[k - 1].kinds} if k else set[str]()
        wrong |= set() if WHO.isdisjoint(who) else {"correction"}
        wrong |= {"team"} if "each" in chunk.kinds and len(standing.groups) < 2 else set()
        yield replace(chunk, kinds={k: v for k, v in chunk.kinds.items() if k not in wrong})
