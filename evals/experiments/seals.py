"""Seals of a run's rows: each holds a hash of itself, of the row before it and of its files.

So a row or a transcript that was edited, and rows that were dropped, repeated or moved are found
and named. This guards against slips and second thoughts, not against recomputing all seals.
"""

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path

from ...tools.errors import InputError
from .trials import TrialRow, canonical

HEAD = "head"
"""The file of a run with the seal of the row that was the last when a runner ended."""


def sealed(row: TrialRow, after: str) -> TrialRow:
    """Return the row with its seal.

    Args:
        row: as the trial gave it.
        after: seal of the row before it; empty for the first.
    """
    linked = row.model_copy(update={"after": after})
    return linked.model_copy(update={"seal": _seal(linked)})


def sealed_all(rows: Iterable[TrialRow]) -> list[TrialRow]:
    """Return rows sealed anew in this order."""
    made, last = list[TrialRow](), ""
    for row in rows:
        made.append(sealed(row, last))
        last = made[-1].seal
    return made


def files_hash(paths: Iterable[Path]) -> str:
    """Return the hash of those files that exist."""
    content = hashlib.sha256()
    for path in paths:
        if path.exists():
            content.update(hashlib.sha256(path.read_bytes()).digest())
    return content.hexdigest()


def check_seals(rows: Sequence[TrialRow], path: Path) -> None:
    """Check all rows of a file against their seals.

    Args:
        rows: as written, in order.
        path: of the file.

    Raises:
        InputError: one was edited, or some are missing, repeated or in another order.
    """
    last = ""
    for number, row in enumerate(rows, start=1):
        what = f"{path} line {number} (task {row.task}, trial {row.trial})"
        if row.seal != _seal(row):
            raise InputError(f"{what} was edited: it is not what its seal is of.")
        if row.after != last:
            raise InputError(
                f"{what} does not follow the line before it: a trial is missing, repeated or moved."
            )
        last = row.seal
    head = path.with_name(HEAD)
    ended = head.read_text("utf-8") if head.exists() else ""
    if ended and ended not in {row.seal for row in rows}:
        raise InputError(f"{path} has lost the trials it ended with: {HEAD} names another.")


def _seal(row: TrialRow) -> str:
    return hashlib.sha256(canonical(row.model_dump(exclude={"seal"}))).hexdigest()
