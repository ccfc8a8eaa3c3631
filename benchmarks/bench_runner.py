"""`python -m formup.benchmarks.bench_runner`: what the runner costs on top of the trials.

It runs 1,500 trials of a policy that does next to nothing, and writes their rows to disk one by
one. With --inspect PYTHON, an interpreter that has inspect_ai, Inspect then runs as many.
"""

import argparse
import json
import random
import subprocess
import tempfile
import time
from pathlib import Path

from ..evals.experiments.executors import Executor, Pool, Serial
from ..evals.experiments.runner import run_trials
from ..evals.experiments.trials import Arm, Trial, TrialRow

TASKS, TRIES = 150, 10
COIN = Arm(method="coin", model="offline")
INSPECT = Path(__file__).parent / "loop" / "peers" / "trials_inspect.py"
"""Exists only in a checkout."""

_inside = [0.0]
"""CPU seconds that this process has spent inside trials."""


def trivial(trial: Trial) -> TrialRow:
    """Toss a biased coin with the trial's seed."""
    began = time.process_time()
    passed = random.Random(trial.seed).random() < 0.7
    row = TrialRow.of(trial, "pass" if passed else "fail", gcr=float(passed))
    _inside[0] += time.process_time() - began
    return row


def trials() -> list[Trial]:
    """Return all tries of all tasks, in one arm."""
    return [
        Trial(suite="0" * 64, task=f"task-{n:03d}", trial=number, arm=COIN)
        for n in range(TASKS)
        for number in range(TRIES)
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="What running 1,500 trials costs beside them.")
    parser.add_argument("--inspect", metavar="PYTHON", help="an interpreter that has inspect_ai")
    chosen = parser.parse_args()
    print(f"{TASKS * TRIES:,} trials {'CPU s':>12} {'wall s':>8} {'CPU ms a trial':>15}")  # noqa: T201
    _ours("formup, serial", Serial())
    _ours("formup, beside a pool", Pool(2))  # the processes of the pool are not counted
    if chosen.inspect:
        done = subprocess.run(
            [chosen.inspect, str(INSPECT), str(TASKS), str(TRIES)],
            capture_output=True,
            text=True,
            check=True,
        )
        for name, cpu, wall in json.loads(done.stdout.splitlines()[-1]):
            _print_row(name, cpu, wall)


def _ours(name: str, executor: Executor) -> None:
    planned = trials()
    _inside[0] = 0.0
    with tempfile.TemporaryDirectory() as folder:
        cpu, wall = time.process_time(), time.perf_counter()
        run_trials(planned, trivial, Path(folder), executor=executor)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    _print_row(name, cpu - _inside[0], wall)


def _print_row(name: str, cpu: float, wall: float) -> None:
    each = 1000 * cpu / (TASKS * TRIES)
    print(f"{name:24} {cpu:8.2f} {wall:8.2f} {each:15.2f}")  # noqa: T201


if __name__ == "__main__":
    main()
