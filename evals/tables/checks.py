"""Checks that a run's folder may be tabled: nothing edited, dropped, repeated or foreign."""

from collections.abc import Collection, Sequence
from pathlib import Path

from ...tools.errors import InputError
from ..experiments.journal import MANIFEST, ROWS, all_rows, read_manifest
from ..experiments.seals import check_seals, files_hash
from ..experiments.suite_work import attempt_files
from ..experiments.trials import Arm, Trial, TrialRow
from ..tasks.stored_suite import ATTEMPTS


def checked_rows(
    folder: Path,
    suite: str,
    planned: Sequence[Trial],
    *,
    methods: Collection[str],
    tasks: Collection[str],
) -> list[TrialRow]:
    """Return the latest row of each trial in a run's folder; none if there is no run yet.

    Args:
        folder: of the run.
        suite: hash of the table's suite.
        planned: all trials of the table.
        methods, tasks: those that are tabled; rows of others need not be planned.

    Raises:
        InputError: the folder or a row is not of this table, or was edited; the text says which.
    """
    if not (folder / MANIFEST).exists():
        return []
    found = read_manifest(folder).suite
    if found != suite:
        raise InputError(
            f"{folder} holds trials of another suite ({found[:12]}, not {suite[:12]}); "
            "use another folder."
        )
    if not (folder / ROWS).exists():
        raise InputError(f"{folder} has a {MANIFEST} and no {ROWS}: its trials are gone.")
    rows = all_rows(folder)
    check_seals(rows, folder / ROWS)
    keys, arms = {t.key for t in planned}, {t.arm.name: t.arm for t in planned}
    for row in rows:
        paths = attempt_files(folder / ATTEMPTS, row)
        if row.files is not None and row.files != files_hash(paths):
            raise InputError(
                f"What {folder / ATTEMPTS} keeps of task {row.task}, trial {row.trial} "
                f"({paths[0].stem}) was edited or is gone."
            )
        if row.arm.method in methods and row.task in tasks and row.key not in keys:
            raise InputError(f"{folder} holds {_unplanned(row, list(arms.values()))}.")
    return list({row.key: row for row in rows}.values())


def _unplanned(row: TrialRow, arms: Sequence[Arm]) -> str:
    """Describe a row that does not belong to the table, and why it does not."""
    if row.arm in arms:
        return f"trial {row.trial} of task {row.task}, which is one more than are tabled"
    for arm in arms:
        same = (arm.method, arm.model, arm.prompt) == (
            row.arm.method,
            row.arm.model,
            row.arm.prompt,
        )
        if same and arm.sha256 != row.arm.sha256:
            hashes = f"#{(row.arm.sha256 or '')[:12]}, not #{(arm.sha256 or '')[:12]}"
            return f"trials of the prompt {arm.prompt} with another text ({hashes})"
        if same and arm.tools != row.arm.tools:
            return f"trials of {arm.name} with other tools than there are now"
    return (
        f"trials of {row.arm.name}, which are not of this table: name the model with --models too"
    )
