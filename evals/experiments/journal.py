"""A run's folder: trials.jsonl, appended and synced row by row, manifest.json, and a lock.

A killed run leaves whole rows and at most one torn line, which is cut off when it is resumed. Rows
of another suite or another version of formup are never mixed in.
"""

import os
from collections.abc import Generator, Iterable, Sequence
from contextlib import ExitStack, contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Self

from pydantic import BaseModel, ConfigDict, ValidationError

from ...prompts.files import lock
from ...tools.errors import InputError
from ...tools.store import write_whole
from ...tools.tool import violations
from .seals import HEAD, check_seals, sealed, sealed_all
from .trials import Arm, Sha, Trial, TrialRow, canonical

ROWS, MANIFEST, LOCK = "trials.jsonl", "manifest.json", ".lock"


class Manifest(BaseModel):
    """What the rows of a folder may be: one suite, one version of formup, these arms."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    suite: Sha
    formup: str
    arms: tuple[Arm, ...]

    @classmethod
    def of(cls, trials: Iterable[Trial]) -> Self:
        """Return the manifest of these trials.

        Raises:
            InputError: there are no trials, or they are of several suites.
        """
        suites, arms = set[str](), dict[bytes, Arm]()
        for trial in trials:
            suites.add(trial.suite)
            arms[canonical(trial.arm.model_dump())] = trial.arm
        if len(suites) != 1:
            raise InputError(f"Trials of {len(suites)} suites cannot be one run; give one suite.")
        ordered = tuple(arms[name] for name in sorted(arms))
        return cls(suite=suites.pop(), formup=version("formup"), arms=ordered)

    def joined(self, other: "Manifest", where: Path) -> "Manifest":
        """Return the manifest with the arms of both.

        Raises:
            InputError: another suite or version of formup; `where` is the folder of the other.
        """
        for name, mine, theirs in (
            ("suite", self.suite[:12], other.suite[:12]),
            ("version of formup", self.formup, other.formup),
        ):
            if mine != theirs:
                raise InputError(
                    f"{where} holds trials of another {name} ({theirs}, not {mine}); "
                    "use another folder."
                )
        arms = {canonical(arm.model_dump()): arm for arm in (*self.arms, *other.arms)}
        return self.model_copy(update={"arms": tuple(arms[name] for name in sorted(arms))})


class Journal:
    """The rows of a folder while one runner holds it.

    Attributes:
        rows: the row of each key: scored, or the latest infrastructure error.
        cost_usd: of all rows ever written.
    """

    def __init__(self, folder: Path, manifest: Manifest) -> None:
        self.rows: dict[str, TrialRow] = {}
        self.cost_usd, self._last = 0.0, ""
        self._folder, self._manifest = folder, manifest
        self._open = ExitStack()

    def __enter__(self) -> Self:
        """Lock the folder, check what is in it, and cut off a torn line.

        Raises:
            InputError: another runner holds it, or its rows are damaged or of another suite.
        """
        with ExitStack() as opening:
            opening.enter_context(held(self._folder))
            self._check_manifest()
            path = self._folder / ROWS
            self._file = opening.enter_context(path.open("ab"))
            whole = path.read_bytes().rpartition(b"\n")
            os.truncate(path, len(whole[0]) + len(whole[1]))
            for row in all_rows(self._folder):
                self._take(row)
            self._open = opening.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        with self._open:
            write_whole(self._folder / HEAD, self._last.encode())

    def append(self, row: TrialRow) -> None:
        """Seal and write a row; when this returns it is on the disk."""
        row = sealed(row, self._last)
        self._file.write(row.line)
        self._file.flush()
        os.fsync(self._file.fileno())
        self._take(row)

    def _take(self, row: TrialRow) -> None:
        self.rows[row.key], self._last = row, row.seal
        self.cost_usd += row.cost_usd

    def _check_manifest(self) -> None:
        path, manifest = self._folder / MANIFEST, self._manifest
        if path.exists():
            manifest = manifest.joined(read_manifest(self._folder), self._folder)
        elif (self._folder / ROWS).exists():
            raise InputError(f"{self._folder} has trials but no {MANIFEST}; use another folder.")
        write_whole(path, manifest.model_dump_json(indent=1).encode())


def read_manifest(folder: Path) -> Manifest:
    """Return the manifest of a run's folder.

    Raises:
        InputError: there is none, or it is damaged.
    """
    path = folder / MANIFEST
    try:
        return Manifest.model_validate_json(path.read_bytes())
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}; a run's folder is needed.") from None
    except ValidationError as error:
        raise InputError(f"{path} is damaged: {violations(error)}") from None


def read_rows(folder: Path) -> list[TrialRow]:
    """Return one row for each trial of a run's folder, in order; a torn last line is left out.

    Raises:
        InputError: no such folder, or it is damaged.
    """
    read_manifest(folder)
    return sorted({row.key: row for row in all_rows(folder)}.values(), key=lambda row: row.order)


def equal_lines(rows: Iterable[TrialRow]) -> bytes:
    """Return sorted rows without times and host: equal for equal results, whoever ran them."""
    return b"".join(row.equal_line for row in sorted(rows, key=lambda row: row.order))


def all_rows(folder: Path) -> list[TrialRow]:
    """Return all rows as written, with infrastructure errors that were tried again.

    Raises:
        InputError: a line is damaged, of another suite, or its trial is scored already.
    """
    path, suite = folder / ROWS, read_manifest(folder).suite
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}.") from None
    rows, scored = list[TrialRow](), set[str]()
    for number, line in enumerate(content.split(b"\n")[:-1], start=1):
        try:
            row = TrialRow.model_validate_json(line)
        except ValidationError as error:
            raise InputError(f"{path} line {number} is damaged: {violations(error)}") from None
        if row.suite != suite:
            raise InputError(f"{path} line {number} is of another suite ({row.suite[:12]}).")
        if row.key in scored:
            raise InputError(
                f"{path} line {number} is of a trial that is scored already: task {row.task}, "
                f"trial {row.trial}."
            )
        rows.append(row)
        scored |= {row.key} if row.scored else set()
    return rows


def merge(shards: Sequence[Path], into: Path) -> int:
    """Put the rows of shards together in a new folder, sorted; return the number of trials.

    A trial in several shards must have the same result in each. Infrastructure errors are kept: the
    merged folder can be resumed.

    Raises:
        InputError: other suites or versions, results that contradict, rows that were edited or
            dropped, `into` has rows, or a folder is named twice.
    """
    named = [folder.resolve() for folder in (*shards, into)]
    if len(set(named)) < len(named):
        raise InputError("A folder is named twice; merge different shards into a new folder.")
    with ExitStack() as stack:
        for folder in shards:
            read_manifest(folder)  # first, as a lock would make a folder that does not exist
            stack.enter_context(held(folder))
            check_seals(all_rows(folder), folder / ROWS)
        manifest = read_manifest(shards[0])
        for folder in shards[1:]:
            manifest = manifest.joined(read_manifest(folder), folder)
        merged = list[TrialRow]()
        done = dict[str, TrialRow]()
        for row in (row for folder in shards for row in all_rows(folder)):
            before = done.get(row.key)
            if before is not None and row.scored and before.equal_line != row.equal_line:
                raise InputError(
                    f"Task {row.task}, trial {row.trial} came out in two ways in these folders; "
                    "a trial is run by one shard."
                )
            if row.scored:
                done[row.key] = row
            if before is None:
                merged.append(row)
        stack.enter_context(held(into))
        if (into / ROWS).exists():
            raise InputError(f"{into} has trials already; merge into a new folder.")
        merged.sort(key=lambda row: (row.order, row.scored))
        write_whole(into / MANIFEST, manifest.model_dump_json(indent=1).encode())
        rows = sealed_all(merged)
        write_whole(into / ROWS, b"".join(row.line for row in rows))
        write_whole(into / HEAD, rows[-1].seal.encode() if rows else b"")
    return len({row.key for row in merged})


@contextmanager
def held(folder: Path) -> Generator[None, None, None]:
    """Lock a folder, which is made if there is none; the system unlocks it when the process ends.

    Raises:
        InputError: another runner holds it, or it cannot be made.
    """
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            file = stack.enter_context((folder / LOCK).open("ab"))
            mine = lock(file.fileno())
        except OSError as error:
            raise InputError(f"{folder} cannot be used: {error.strerror or error}.") from None
        if not mine:
            raise InputError(
                f"Another runner works in {folder}; wait for it, or use another folder."
            )
        yield
