"""Trials for the tests of the runner, importable by the processes that run them.

Run as a script it is a sweep to be killed: FOLDER, then seconds that each trial takes; with `ray`
after them, one on Ray in which a provider is down.
"""

import random
import sys
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from formup.evals.experiments.executors import Ray
from formup.evals.experiments.runner import run_trials
from formup.evals.experiments.trials import Arm, Trial, TrialRow
from formup.tools.errors import ModelError

SUITE = "a" * 64


@dataclass(frozen=True)
class Coin:
    """Passes seven times of ten; what it says depends on the trial alone."""

    seconds: float = 0.0
    broken: str = ""

    def __call__(self, trial: Trial) -> TrialRow:
        time.sleep(self.seconds)
        if trial.task == self.broken:
            raise ModelError("The provider is down.")
        luck = random.Random(trial.key)
        passed = luck.random() < 0.7
        return TrialRow.of(
            trial,
            "pass" if passed else "fail",
            gcr=1.0 if passed else round(luck.random(), 3),
            feedback="" if passed else "robot 3 stands inside; é\u2028",
            input_tokens=luck.randrange(2000),
            cost_usd=0.01,
        )


def sweep(tasks: int = 4, tries: int = 3, *, suite: str = SUITE, model: str = "m") -> list[Trial]:
    """Two prompts on some tasks."""
    return [
        Trial(
            suite=suite,
            task=f"t{task}",
            trial=number,
            arm=Arm(
                method="agent", prompt=f"former@v00{version}", sha256=str(version) * 64, model=model
            ),
        )
        for version in (1, 2)
        for task in range(tasks)
        for number in range(tries)
    ]


if __name__ == "__main__":
    folder, seconds, *more = sys.argv[1:]
    if more == ["ray"]:
        broken = import_module("trial_work").Coin(broken="t2")  # as workers know it, not __main__
        run_trials(sweep(8, 10), broken, Path(folder), executor=Ray(workers=2))
    else:
        run_trials(sweep(8, 10), Coin(float(seconds)), Path(folder))
