"""Folders of policies, and their row of table 1: what is shown, set apart, and refused."""

import csv
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.apps.cli import app
from formup.evals.experiments.journal import read_rows
from formup.evals.rl.curve import picture, summary
from formup.evals.rl.policy import places, read_checkpoints, trained
from formup.evals.rl.teams import CATEGORIES, SEEN
from formup.evals.tasks.suites import load_suite
from formup.tools.errors import InputError

TABLE = ["eval", "table", "1", "--method", "rl", "--task", "us_coins_t1", "--trials", "4"]
ROW = "reinforcement learning"


def write_policies(folder: Path, *, late: str = "") -> Path:
    """Two seeds of each category that know nothing; those of one may have come to no end."""
    folder.mkdir()
    random = np.random.default_rng(0)
    for category in CATEGORIES:
        for seed in range(2):
            sizes = (SEEN, 8, 2)
            layers = {f"w{i}": random.normal(size=sizes[i : i + 2][::-1]) for i in range(2)}
            layers |= {f"b{i}": random.normal(size=sizes[i + 1]) for i in range(2)}
            weights = folder / f"{category}-{seed}.npz"
            with weights.open("wb") as file:
                np.savez(file, allow_pickle=False, **layers)
            said: dict[str, Any] = {
                "category": category,
                "seed": seed,
                "robots": 6,
                "budget": 100,
                "versions": {},
            }
            said |= {"converged": category != late, "curve": [[50, 0.2], [100, 0.4 + seed / 5]]}
            said["sha256"] = hashlib.sha256(weights.read_bytes()).hexdigest()
            weights.with_suffix(".json").write_text(json.dumps(said), encoding="utf-8")
    return folder


def formup(*arguments: str | Path) -> int:
    return app([*map(str, arguments)], standalone_mode=False) or 0


def totals(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "table.csv").open(encoding="utf-8", newline="") as file:
        return {line["row"]: line for line in csv.DictReader(file) if line["column"] == "total"}


def test_converged_policies_stand_beside_the_papers_figures(tmp_path: Path) -> None:
    policies, out = write_policies(tmp_path / "policies"), tmp_path / "run"
    assert formup(*TABLE, "--checkpoints", policies, "--out", out) == 0
    (line,) = totals(out).values()
    assert line["row"] == f"{ROW}: PPO on true outlines, teams of 6, 2 seeds"
    assert (line["scored"], line["planned"], line["paper_sr"]) == ("4", "4", "0.5")
    rows = sorted(read_rows(out), key=lambda row: row.trial)
    assert {row.arm.model for row in rows} == {f"ppo#{trained(policies).sha256[:12]}"}
    assert len({row.gcr for row in rows}) > 1  # by the seed of the policy, and where robots start


def test_where_robots_go_is_the_same_for_the_same_try(tmp_path: Path) -> None:
    policies = write_policies(tmp_path / "policies")
    goals = next(t for t in load_suite("zerocap15").tasks if t.id == "us_coins_t1").goals
    first, same, start, seed = (
        places(policies, "caging", goals, trial, start)
        for trial, start in ((0, 7), (2, 7), (0, 8), (1, 7))
    )
    assert first.shape == (10, 2)
    assert np.array_equal(first, same)
    assert not np.array_equal(first, start)
    assert not np.array_equal(first, seed)


def test_unconverged_policies_have_a_row_apart_from_the_papers_figures(tmp_path: Path) -> None:
    policies = write_policies(tmp_path / "policies", late="caging")
    assert formup(*TABLE, "--checkpoints", policies, "--out", tmp_path / "run") == 0
    found = totals(tmp_path / "run")
    own = found.pop(
        f"{ROW}: PPO on true outlines, teams of 6, 2 seeds; unconverged in caging, not the paper's"
    )
    assert (own["scored"], own["paper_sr"]) == ("4", "")
    assert list(found) == [ROW]
    assert (found[ROW]["scored"], found[ROW]["paper_sr"]) == ("0", "0.5")
    assert (
        "not run: what was trained is unconverged; formup eval train-rl with more --steps"
        in found[ROW]["remarks"]
    )


def test_without_policies_the_table_says_what_makes_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert formup("eval", "table", "1", "--method", "rl", "--dry-run", "--format", "markdown") == 0
    said = "not run: 150 trials for want of --checkpoints DIR, which formup eval train-rl --out DIR"
    assert said in capsys.readouterr().out


def test_what_is_not_what_was_trained_is_refused(tmp_path: Path) -> None:
    policies = write_policies(tmp_path / "policies")
    with pytest.raises(InputError, match="No row of this table is for the checkpoints"):
        formup("eval", "table", "3", "--dry-run", "--checkpoints", policies)
    with pytest.raises(InputError, match="rl takes a --model, such as DIR, a folder that formup"):
        formup("eval", "run", "smoke", "--method", "rl")
    with (policies / "infill-1.npz").open("ab") as file:
        file.write(b"more")
    with pytest.raises(InputError, match=r"infill-1\.npz is not the file that was trained"):
        trained(policies)
    for path in policies.glob("infill-*.json"):
        path.unlink()
    with pytest.raises(InputError, match=r"no policy for infill; .* --category infill"):
        trained(policies)
    (policies / "general-0.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match=r"general-0\.json does not say how a policy was trained"):
        trained(policies)


def test_a_curve_is_of_all_seeds_and_those_that_stopped_keep_their_last_score(
    tmp_path: Path,
) -> None:
    made = read_checkpoints(write_policies(tmp_path / "policies"))
    steps, mean, (low, high) = summary(made[:2])
    assert steps == [50, 100]
    assert mean == pytest.approx([0.2, 0.5])
    assert (low[1], high[1]) == (pytest.approx(0.4), pytest.approx(0.6))
    longer = made[1].model_copy(update={"curve": ((50, 0.2), (200, 0.8))})
    assert summary([made[0], longer])[1][-1] == pytest.approx(0.6)
    assert picture(made).startswith(b"\x89PNG")


def test_training_without_its_extra_and_with_what_it_does_not_take(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "formup.evals.rl.train", None)
    train = ["eval", "train-rl", "--out", str(tmp_path / "none")]
    with pytest.raises(InputError, match=r"needs an extra: pip install 'formup\[rl\]'"):
        formup(*train)
    assert not (tmp_path / "none").exists()
    with pytest.raises(InputError, match=r"Unknown category 'herd'. There are: general"):
        formup(*train, "--category", "herd")
    policies = write_policies(tmp_path / "policies")
    with pytest.raises(InputError, match="policies for teams of 6, not 8; use another folder"):
        formup("eval", "train-rl", "--out", policies)
