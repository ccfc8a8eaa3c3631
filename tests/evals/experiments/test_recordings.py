"""Conversations with somebody who saw what a model sees, replayed: every one comes out the same."""

import json
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from formup.agent.store.folder import read_events
from formup.evals.experiments.methods import Method
from formup.evals.experiments.recordings import Recordings
from formup.evals.experiments.trials import TrialRow
from formup.evals.tasks.suites import load_suite
from formup.tools.errors import InputError

trying = import_module("trying")
tried: Callable[..., list[TrialRow]] = trying.tried

RECORDED = Path(__file__).parents[2] / "recordings"
TASKS = {t.id: t for name in ("photos", "many", "dialogues") for t in load_suite(name).tasks}


def recordings(*folders: str) -> list[Path]:
    return sorted(path for name in folders for path in (RECORDED / name).glob("*.jsonl"))


ALL = recordings("photos", "many", "two-stages")


@cache
def replay(path: Path) -> tuple[TrialRow, dict[str, Any]]:
    """The row and the attempt of a recording, replayed once by each process that asks for it."""
    arm = Method("agent", f"replay:{path.parent}")
    with TemporaryDirectory() as folder:
        (row,) = tried([TASKS[path.stem]], arm, Path(folder))
        (attempt,) = Path(folder).glob("*.json")
        return row, json.loads(attempt.read_bytes())


def rows(folder: str) -> list[TrialRow]:
    return [replay(path)[0] for path in recordings(folder)]


@pytest.mark.parametrize("path", ALL, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_ends_as_recorded(path: Path) -> None:
    row, attempt = replay(path)
    *_, last = read_events(path)
    assert last.kind == "end"
    end = last.data
    assert (row.outcome, attempt["message"]) == (end["status"], end["message"])
    assert row.requests == end["usage"]["requests"]


@pytest.mark.parametrize("path", recordings("dialogues"), ids=lambda path: path.stem)
def test_each_turn_of_a_dialogue_ends_as_recorded_and_right(path: Path) -> None:
    row, attempt = replay(path)
    ends = [event.data for event in read_events(path) if event.kind == "end"]
    made = [(turn["status"], turn["message"]) for turn in attempt["turns"]]
    assert made == [(end["status"], end["message"]) for end in ends]
    assert row.turns is not None
    assert row.turns.right == row.turns.total == len(ends) == 4
    assert row.requests == sum(end["usage"]["requests"] for end in ends)


def test_recorded_dialogues_are_counted_as_no_models_and_no_prompts() -> None:
    found = rows("dialogues")
    assert len(found) == 3
    arm = found[0].arm
    assert all(row.arm == arm for row in found)
    assert (arm.model or "").startswith("replay:dialogues#")
    assert (arm.prompt, arm.sha256) == (None, None)


def test_the_attempts_of_a_run_are_recordings_too(tmp_path: Path) -> None:
    (path, *_) = recordings("photos")
    for name in (f"{path.stem}-0-0123456789ab", f"{path.stem}-1-ba9876543210"):
        (tmp_path / f"{name}.jsonl").write_bytes(path.read_bytes())
    found = Recordings(tmp_path)
    assert str(found.of(path.stem, 1)).endswith("ba9876543210.jsonl")
    assert found.of(path.stem, 2) is None
    (tmp_path / f"{path.stem}-1-another.jsonl").touch()
    with pytest.raises(InputError, match="keep those of one arm"):
        found.of(path.stem, 1)


def test_a_clear_case_takes_few_requests() -> None:
    found = rows("photos")
    assert len(found) >= 24
    assert {row.category for row in found} == {"general", "infill", "caging"}
    assert {row.setup for row in found} == {"single", "multi", "hidden"}
    assert median(row.requests for row in found) <= 3


def test_nearly_all_are_strictly_right() -> None:
    found = rows("photos")
    assert sum(bool(row.strict) for row in found) >= 0.95 * len(found)
    assert all(row.object_correct for row in found)


def test_many_robots_at_a_stated_clearance() -> None:
    """Two of twelve are not: docs/seeing.md says why."""
    found = rows("many")
    assert len(found) == 12
    assert all(24 <= (TASKS[row.task].robots or 0) <= 40 for row in found)
    missed = {row.task for row in found if not row.strict}
    assert missed == {"cars_two_many", "table_stuff_lid_many"}
    assert median(row.requests for row in found) <= 3
