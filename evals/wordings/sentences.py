"""Sentences of many authors, marked by hand: which words are thing, demand and background."""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib import resources

from ...agent.offline.tagging import MEANINGS, Token, tokens
from ...tools.errors import InputError


@dataclass(frozen=True)
class Sentence:
    """An instruction and what its author marked.

    Attributes:
        author: the one in whose file it is.
        text: the instruction.
        words: its tokens.
        labels: what each token is there for, of tagging.LABELS.
        meaning: one of tagging.MEANINGS.
        robots: how many in all; None if it does not say.
    """

    author: str
    text: str
    words: tuple[Token, ...]
    labels: tuple[str, ...]
    meaning: str
    robots: int | None


def shipped_sentences() -> tuple[Sentence, ...]:
    """Return all sentences of this folder's authors."""
    folder = resources.files(__package__ or "").joinpath("authors")
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".jsonl")), key=lambda f: f.name)
    return tuple(s for f in files for s in read_sentences(f.name[:-6], f.read_text("utf-8")))


def read_sentences(author: str, lines: str) -> Iterator[Sentence]:
    """Yield the sentences of one author's JSON lines.

    Raises:
        InputError: a line has an unknown relation, or marks a phrase that is not in its text.
    """
    for number, line in enumerate(lines.splitlines(), 1):
        if not line.strip():
            continue
        row = json.loads(line)
        if row.get("relation") not in MEANINGS:
            raise InputError(
                f"{author}, line {number}: relation {row.get('relation')!r} is none of "
                f"{', '.join(MEANINGS)}."
            )
        words = tokens(row["text"])
        labels = ["command"] * len(words)
        for label, key in (
            ("background", "background"),
            ("demand", "demands"),
            ("thing", "things"),
        ):
            for phrase in row[key]:
                _mark(labels, words, _spans(row["text"], phrase, f"{author}, line {number}"), label)
        yield Sentence(author, row["text"], words, tuple(labels), row["relation"], row["robots"])


def _spans(text: str, phrase: str, where: str) -> Sequence[tuple[int, int]]:
    at = text.find(phrase)
    if at < 0:
        raise InputError(f"{where}: {phrase!r} does not stand in the text; quote it exactly.")
    return [(at, at + len(phrase))]


def _mark(
    labels: list[str], words: Sequence[Token], spans: Iterable[tuple[int, int]], label: str
) -> None:
    for start, end in spans:
        for i, word in enumerate(words):
            if start <= word.start < end:
                labels[i] = label
