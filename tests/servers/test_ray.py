"""Sweeps on Ray, in the environment that has it: the same rows as here, byte for byte; the page."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from formup.evals.experiments.journal import equal_lines, read_rows
from formup.evals.experiments.runner import run_trials
from formup.evals.experiments.trials import Trial, TrialRow

EVALS = Path(__file__).parents[1] / "evals"
PAGE = Path(__file__).parents[2] / "docs/cluster.md"
sys.path.insert(0, str(EVALS))
trial_work: Any = import_module("trial_work")
sweep: Callable[..., list[Trial]] = trial_work.sweep
Coin: Callable[..., Callable[[Trial], TrialRow]] = trial_work.Coin


def test_ray_gives_the_same_bytes(environments: Path, tmp_path: Path) -> None:
    run_trials(sweep(8, 10), Coin(broken="t2"), tmp_path / "serial")
    subprocess.run(
        [environments / "ray/bin/python", EVALS / "trial_work.py", tmp_path / "ray", "0", "ray"],
        env=os.environ | {"PYTHONPATH": str(EVALS), "HOME": str(tmp_path)},
        check=True,
    )
    rows = read_rows(tmp_path / "ray")
    assert len(rows) == 160
    assert equal_lines(rows) == equal_lines(read_rows(tmp_path / "serial"))


def test_the_page_runs_a_suite(environments: Path, tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    done = subprocess.run(
        [environments / "ray/bin/python", "-c", code],
        cwd=tmp_path,
        env=os.environ | {"HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "30 of 30 trials, 0.00 USD \n", done.stderr
    assert len(read_rows(tmp_path / "runs/smoke")) == 30
