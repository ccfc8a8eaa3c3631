"""Training through PPO itself, for a few steps: figures say nothing, files and words do."""

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.apps.cli import app
from formup.evals.rl.policy import read_checkpoints, trained
from formup.evals.rl.teams import SEEN

if not find_spec("stable_baselines3"):
    pytest.skip("needs formup[rl]: make test-torch", allow_module_level=True)

FEW = ["-n", "2", "--seeds", "1", "--steps", "1000"]
HASHED = ("category", "seed", "curve", "sha256")


def train(folder: Path, *more: str) -> None:
    assert not app(["eval", "train-rl", "--out", str(folder), *FEW, *more], standalone_mode=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("policies")
    train(made)
    return made


def test_a_seed_twice_makes_the_same_policy_and_what_is_trained_is_left(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    train(tmp_path, "--category", "caging")
    (again,) = read_checkpoints(tmp_path)
    first = read_checkpoints(folder)[-1]
    assert again.model_dump(include=set(HASHED)) == first.model_dump(include=set(HASHED))
    assert not again.converged
    before = {path: path.stat().st_mtime_ns for path in folder.glob("*.npz")}
    assert len(before) == 3
    capsys.readouterr()
    train(folder)
    assert {path: path.stat().st_mtime_ns for path in before} == before
    said = capsys.readouterr().out
    assert f"unconverged: the budget ended it; weights {first.sha256[:12]}" in said
    assert "interquartile mean of seeds: 1" in said
    assert (folder / "curve.png").read_bytes().startswith(b"\x89PNG")


def test_arrays_act_as_the_network_they_were_taken_from(folder: Path) -> None:
    module: Any = import_module("formup.evals.rl.train")
    env = module.Robots("infill", 2, 0)
    model: Any = import_module("stable_baselines3").PPO("MlpPolicy", env, **module.SETTINGS)
    seen = np.random.default_rng(0).uniform(-3, 3, (50, SEEN)).astype(np.float32)
    wanted, _ = model.predict(seen, deterministic=True)
    assert module.actor(model)(seen) == pytest.approx(wanted, abs=1e-5)
    assert trained(folder).unconverged == ["general", "infill", "caging"]


def test_a_plateau_is_where_scores_no_longer_rise() -> None:
    plateau = import_module("formup.evals.rl.train").plateau
    rising = [i / 40 for i in range(30)]
    assert not any(plateau(rising[:n]) for n in range(31))
    assert not plateau([0.9] * 15)
    assert plateau([*rising, *[0.9] * 16])
