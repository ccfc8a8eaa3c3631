"""The runner: killed at any moment it goes on, within its budget, and equal on every executor."""

import random
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from formup.evals.experiments.executors import Executor, Pool, Ray, Serial, executor
from formup.evals.experiments.journal import MANIFEST, ROWS, equal_lines, held, merge, read_rows
from formup.evals.experiments.runner import Progress, balanced, part, run_trials
from formup.evals.experiments.trials import Trial, TrialRow
from formup.tools.errors import InputError, ModelError
from pydantic import ValidationError

HERE = Path(__file__).parents[1]
sys.path.insert(0, str(HERE))  # so that processes of a pool find it as well
trial_work: Any = import_module("trial_work")
sweep: Callable[..., list[Trial]] = trial_work.sweep
Coin: Callable[..., Callable[[Trial], TrialRow]] = trial_work.Coin
FIRST = sweep()[0]


def result(folder: Path) -> bytes:
    return equal_lines(read_rows(folder))


def test_a_trial_is_known_by_all_it_depends_on() -> None:
    changes: dict[str, object] = {"suite": "b" * 64, "task": "u", "trial": 1, "style": "fresh"}
    arms: dict[str, object] = {
        "method": "alone",
        "prompt": "former@v009",
        "sha256": "9" * 64,
        "tools": "9" * 64,
        "model": "other",
        "descriptor": "matrix",
        "mode": "box",
    }
    others = [FIRST.model_copy(update={name: value}) for name, value in changes.items()]
    for name, value in arms.items():
        others.append(FIRST.model_copy(update={"arm": FIRST.arm.model_copy(update={name: value})}))
    keys = {Trial.model_validate(other.model_dump()).key for other in others}
    assert len({FIRST.key, *keys}) == 12


def test_arms_meet_the_same_seed() -> None:
    seeds: dict[tuple[str, int], set[int]] = {}
    for trial in sweep():
        seeds.setdefault((trial.task, trial.trial), set()).add(trial.seed)
    assert all(len(met) == 1 for met in seeds.values())
    assert len({seed for met in seeds.values() for seed in met}) == len(seeds) == 12


@pytest.mark.parametrize(
    "facts",
    [
        {"status": "pass", "sr": False},
        {"status": "fail", "sr": True},
        {"status": "model_invalid", "sr": None},
        {"status": "infra_error", "sr": False},
        {"status": "infra_error", "gcr": 0.0},
        {"status": "fail", "sr": False, "strict": True},
        {"status": "fail", "sr": False, "gcr": 1.5},
        {"status": "fail", "sr": False, "cost_usd": float("inf")},
    ],
)
def test_rows_that_contradict_themselves(facts: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        TrialRow(**FIRST.model_dump(), **facts)


def test_a_row_survives_its_line() -> None:
    row = TrialRow.of(FIRST, "fail", gcr=0.1, feedback='a "line"\nbreak é\u2028', seconds=1.5)
    assert row.line.count(b"\n") == 1
    assert TrialRow.model_validate_json(row.line) == row
    assert row.key == FIRST.key
    assert b"seconds" not in row.equal_line


def test_order_is_balanced() -> None:
    ordered = balanced(sweep(3, 2))
    assert [t.trial for t in ordered] == [0] * 6 + [1] * 6
    cells = [ordered[i : i + 2] for i in range(0, 12, 2)]
    assert all(a.task == b.task and a.arm != b.arm for a, b in cells)
    firsts = [a.arm.prompt for a, _ in cells]
    assert firsts.count("former@v001") == firsts.count("former@v002") == 3
    shuffled = sweep(3, 2)
    random.Random(0).shuffle(shuffled)
    assert {t.key for t in balanced(shuffled)} == {t.key for t in ordered}
    with pytest.raises(InputError, match="given twice"):
        balanced([FIRST, FIRST])


def test_a_run_is_gone_on_with(tmp_path: Path) -> None:
    whole, asked = tmp_path / "whole", list[str]()

    def counting(trial: Trial) -> TrialRow:
        asked.append(trial.key)
        return Coin()(trial)

    run_trials(sweep(), Coin(), whole)
    run_trials(sweep(4, 1), counting, tmp_path / "parts")
    seen = list[Progress]()
    swept = run_trials(sweep(), counting, tmp_path / "parts", done=seen.append)
    assert len(asked) == len(set(asked)) == swept.scored == swept.total == 24
    assert [p.done for p in seen] == list(range(8, 25))
    assert swept.cost_usd == pytest.approx(0.24) == seen[-1].cost_usd
    assert result(tmp_path / "parts") == result(whole)
    assert (tmp_path / "parts" / MANIFEST).read_bytes() == (whole / MANIFEST).read_bytes()


def test_killed_at_any_moment_it_goes_on(tmp_path: Path) -> None:
    trials = sweep(8, 10)
    run_trials(trials, Coin(), tmp_path / "whole")
    luck, folder, counts = random.Random(), tmp_path / "killed", [0]
    command = [sys.executable, str(HERE / "trial_work.py"), str(folder), "0.01"]
    for _ in range(5):
        process = subprocess.Popen(command)
        rows = folder / ROWS
        while process.poll() is None and not (
            rows.exists() and rows.read_bytes().count(b"\n") > counts[-1]
        ):
            time.sleep(0.005)
        time.sleep(luck.random() * 0.2)
        process.kill()
        process.wait()
        counts.append(rows.read_bytes().count(b"\n"))
    assert counts == sorted(set(counts))  # every run added to what was there
    run_trials(trials, Coin(), folder)
    assert result(folder) == result(tmp_path / "whole")
    assert (folder / ROWS).read_bytes().count(b"\n") == len(trials)  # nothing was done twice


@pytest.mark.parametrize("kept", [1, 30, -1])
def test_a_torn_line_is_cut_off(tmp_path: Path, kept: int) -> None:
    run_trials(sweep(), Coin(), tmp_path)
    before = result(tmp_path)
    path = tmp_path / ROWS
    *lines, last = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines) + last[:kept])
    assert len(read_rows(tmp_path)) == 23
    run_trials(sweep(), Coin(), tmp_path)
    assert result(tmp_path) == before


def test_infrastructure_errors_are_tried_again(tmp_path: Path) -> None:
    swept = run_trials(sweep(), Coin(broken="t1"), tmp_path)
    assert (swept.scored, swept.stopped) == (18, None)
    errors = [row for row in read_rows(tmp_path) if not row.scored]
    assert {row.feedback for row in errors} == {"ModelError: The provider is down."}
    assert run_trials(sweep(), Coin(), tmp_path).scored == 24
    assert all(row.scored for row in read_rows(tmp_path))


def test_a_provider_that_is_down_ends_the_run(tmp_path: Path) -> None:
    def down(trial: Trial) -> TrialRow:
        raise ModelError("No such key.")

    swept = run_trials(sweep(), down, tmp_path)
    assert swept.stopped == "10 infrastructure errors in a row; the last: ModelError: No such key."
    assert len(read_rows(tmp_path)) == 10


def test_a_bug_is_no_infrastructure_error(tmp_path: Path) -> None:
    def buggy(trial: Trial) -> TrialRow:
        return TrialRow.of(FIRST, "pass") if trial != FIRST else Coin()(trial)

    with pytest.raises(ValueError, match="is another trial's"):
        run_trials(sweep(), buggy, tmp_path)
    assert len(read_rows(tmp_path)) == 1


@pytest.mark.parametrize("where", ["serial", "pool"])
def test_the_budget_is_not_exceeded(tmp_path: Path, where: str) -> None:
    swept = run_trials(sweep(), Coin(), tmp_path, budget_usd=0.105, executor=executor(where, 2))
    assert (swept.scored, swept.cost_usd) == (10, pytest.approx(0.10))
    assert swept.stopped == (
        "The next trial could exceed the budget: 0.1000 USD are spent, 14 of 24 trials are left."
    )
    again = run_trials(sweep(), Coin(), tmp_path, budget_usd=0.105)
    assert (again.scored, again.stopped) == (10, swept.stopped)
    assert run_trials(sweep(), Coin(), tmp_path, budget_usd=1).scored == 24
    with pytest.raises(InputError, match="buys nothing"):
        run_trials(sweep(), Coin(), tmp_path, budget_usd=0)


def test_folders_are_of_one_suite_and_one_runner(tmp_path: Path) -> None:
    run_trials(sweep(), Coin(), tmp_path)
    with pytest.raises(InputError, match=r"holds trials of another suite \(aaaaaaaaaaaa, not bbb"):
        run_trials(sweep(suite="b" * 64), Coin(), tmp_path)
    with pytest.raises(InputError, match="2 suites cannot be one run"):
        run_trials([*sweep(), *sweep(suite="b" * 64)], Coin(), tmp_path)
    with held(tmp_path), pytest.raises(InputError, match="Another runner works in"):
        run_trials(sweep(), Coin(), tmp_path)
    (tmp_path / MANIFEST).unlink()
    with pytest.raises(InputError, match=r"has trials but no manifest\.json"):
        run_trials(sweep(), Coin(), tmp_path)


def test_damaged_and_doubled_rows_are_named(tmp_path: Path) -> None:
    run_trials(sweep(), Coin(), tmp_path)
    path = tmp_path / ROWS
    good = path.read_bytes()
    first = good.splitlines(keepends=True)[0]
    for added, said in (
        (first, "line 25 is of a trial that is scored already: task t0, trial 0"),
        (b"{}\n", "line 25 is damaged"),
        (first.replace(b"a" * 64, b"b" * 64), "line 25 is of another suite"),
    ):
        path.write_bytes(good + added)
        with pytest.raises(InputError, match=said):
            read_rows(tmp_path)
        with pytest.raises(InputError, match=said):
            run_trials(sweep(), Coin(), tmp_path)


def test_shards_put_together_are_the_whole(tmp_path: Path) -> None:
    run_trials(sweep(), Coin(), tmp_path / "whole")
    folders = [tmp_path / f"part{i}" for i in (1, 2, 3)]
    counts = [
        run_trials(sweep(), Coin(), folder, shard=f"{i}/3").total
        for i, folder in enumerate(folders, start=1)
    ]
    assert sum(counts) == 24
    assert all(counts)
    assert merge(folders, tmp_path / "merged") == 24
    assert result(tmp_path / "merged") == result(tmp_path / "whole")
    manifests = [(tmp_path / name / MANIFEST).read_bytes() for name in ("merged", "whole")]
    assert manifests[0] == manifests[1]
    assert run_trials(sweep(), Coin(), tmp_path / "merged").scored == 24
    with pytest.raises(InputError, match="has trials already"):
        merge(folders, tmp_path / "merged")
    for named, into in (([*folders, folders[0]], "new"), (folders, folders[0].name)):
        with pytest.raises(InputError, match="named twice"):
            merge(named, tmp_path / into)


def test_merging_checks_what_it_is_given(tmp_path: Path) -> None:
    run_trials(sweep(), Coin(), tmp_path / "a")
    run_trials(sweep(suite="b" * 64), Coin(), tmp_path / "b")
    with pytest.raises(InputError, match="another suite"):
        merge([tmp_path / "a", tmp_path / "b"], tmp_path / "c")
    run_trials(sweep(), lambda t: TrialRow.of(t, "fail", gcr=0.0), tmp_path / "d")
    with pytest.raises(InputError, match="came out in two ways"):
        merge([tmp_path / "a", tmp_path / "d"], tmp_path / "e")
    run_trials(sweep(), Coin(broken="t1"), tmp_path / "f")
    assert merge([tmp_path / "f", tmp_path / "a"], tmp_path / "g") == 24
    assert result(tmp_path / "g") == result(tmp_path / "a")
    with pytest.raises(InputError, match="a run's folder is needed"):
        merge([tmp_path / "nothing"], tmp_path / "h")


@pytest.mark.parametrize("text", ["0/3", "4/3", "1", "a/b", "1/0", "-1/3"])
def test_shards_that_are_none(text: str) -> None:
    with pytest.raises(InputError, match="give i/n"):
        part(sweep(), text)


def test_executors_have_names() -> None:
    made = [executor(name, 1) for name in ("serial", "pool", "ray")]
    assert [type(one) for one in made] == [Serial, Pool, Ray]
    with pytest.raises(InputError, match="There are: serial, pool, ray"):
        executor("slurm")


def equal_to_serial(tmp_path: Path, other: Executor) -> None:
    run_trials(sweep(), Coin(broken="t2"), tmp_path / "serial")
    run_trials(sweep(), Coin(broken="t2"), tmp_path / "other", executor=other)
    assert result(tmp_path / "other") == result(tmp_path / "serial")
    assert len(read_rows(tmp_path / "other")) == 24


def test_a_pool_gives_the_same_bytes(tmp_path: Path) -> None:
    equal_to_serial(tmp_path, Pool(2))


@pytest.mark.skipif(find_spec("ray") is not None, reason="Ray is installed")
def test_without_ray_the_extra_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"formup\[ray\]"):
        run_trials(sweep(), Coin(), tmp_path, executor=Ray())
