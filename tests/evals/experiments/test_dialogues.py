"""Dialogues as tasks: how they are read, held with an agent, and written down."""

import json
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml
from formup.evals.experiments.executors import executor
from formup.evals.experiments.journal import read_rows
from formup.evals.experiments.methods import Method, check_method
from formup.evals.experiments.pointing import pointing
from formup.evals.experiments.runner import run_trials
from formup.evals.experiments.trials import TrialRow, Turns
from formup.evals.tasks.suites import load_suite
from formup.tools.errors import InputError

work_of: Callable[..., Any] = import_module("trying").work_of

TURNS = [
    {"say": "put 8 robots around it", "expect": "plan", "robots": 8, "form": "around"},
    {"say": "frobnicate the gizmo", "expect": "refuse"},
    {"say": "frobnicate it again", "expect": "edit", "robots": 5},
]


def written(folder: Path, turns: list[dict[str, Any]], **more: Any) -> str:
    given = {"id": "plate", "scene": 711, "point": ["plate_0"], "turns": turns} | more
    listed = folder / "talk.yaml"
    listed.write_text(yaml.safe_dump([given]))
    item = {"dialogues": "talk.yaml", "category": "talk"}
    suite = {"name": "mine", "description": "Mine.", "tasks": [item]}
    (folder / "suite.yaml").write_text(yaml.safe_dump(suite))
    return str(folder)


@pytest.mark.parametrize(
    ("turns", "more", "wrong"),
    [
        ([{"say": "hi", "expect": "edit", "colour": "red"}], {}, "no 'colour'"),
        ([{"say": "hi", "expect": "dance"}], {}, "'dance' is not one of"),
        ([{"say": "", "expect": "edit"}], {}, "breaks the format of dialogues"),
        ([{"say": "hi", "expect": "edit", "point": "cup"}], {}, "no 'cup' in its picture"),
        (TURNS, {"point": ["cup"]}, "no 'cup' in its picture"),
        (TURNS, {"scene": None}, "is not of type 'integer'"),
    ],
)
def test_what_is_wrong_with_a_dialogue_is_said(
    tmp_path: Path, turns: list[dict[str, Any]], more: dict[str, Any], wrong: str
) -> None:
    with pytest.raises(InputError, match=wrong):
        load_suite(written(tmp_path, turns, **more))


def test_a_thing_pointed_at_later_takes_the_next_number(tmp_path: Path) -> None:
    turns = [
        {"say": "8 robots around it", "expect": "plan"},
        {"say": "around this instead", "expect": "edit", "point": "raft_4", "target": "t2"},
    ]
    (task,) = load_suite(written(tmp_path, turns, scene=728, point=["raft_2"])).tasks
    assert task.dialogue is not None
    assert [thing.id for thing in task.things] == ["raft_2", "raft_4"]
    point = task.dialogue.turns[1].point
    assert point is not None
    assert task.things[1].outline.bounds[0] < point[0] < task.things[1].outline.bounds[2]
    assert [prompt.id for prompt in pointing(task, "words", 0).pointed] == ["t1"]
    assert [target.label for target in pointing(task, "truth", 0).targets] == ["orange raft"]


def test_only_what_has_tools_holds_dialogues(tmp_path: Path) -> None:
    (task,) = load_suite(written(tmp_path, TURNS)).tasks
    assert check_method(Method("rules")).takes(task)
    assert not check_method(Method("pile")).takes(task)
    assert not check_method(Method("rules", mode="box")).takes(task)


def test_a_dialogue_is_one_row_with_its_turns_counted(tmp_path: Path) -> None:
    tasks = load_suite(written(tmp_path, TURNS)).tasks
    arm = check_method(Method("rules", mode="truth"))
    attempts = tmp_path / "attempts"
    attempts.mkdir()
    work, trials = work_of(tasks, arm, tmp_path, 1, attempts)
    run_trials(trials, work, tmp_path / "run", executor=executor("serial"))
    (row,) = read_rows(tmp_path / "run")
    assert (row.status, row.sr, row.turns) == (
        "fail",
        False,
        Turns(total=3, right=2, still=1, kept=1),
    )
    assert row.gcr == pytest.approx(2 / 3)
    assert "turn 3 'frobnicate it again': question, planned was right: " in row.feedback
    (path,) = attempts.glob("*.json")
    turns = json.loads(path.read_text())["turns"]
    assert [turn["words"] for turn in turns] == [turn["say"] for turn in TURNS]
    assert {turn["plan_id"] for turn in turns} == {turns[0]["plan_id"]}
    assert TrialRow.model_validate_json(row.line) == row
