"""Inspect AI: the same number of trials of a solver without a model, in its own environment."""

import json
import os
import random
import sys
import tempfile
import time

from inspect_ai import Task, eval, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.model import ModelOutput
from inspect_ai.scorer import match
from inspect_ai.solver import solver

TASKS, TRIES = int(sys.argv[1]), int(sys.argv[2])


@solver
def coin():
    """Toss a coin, without a model."""

    async def solve(state, generate):
        heads = random.Random(f"{state.sample_id} {state.epoch}").random() < 0.7
        state.output = ModelOutput.from_content("mockllm/model", "heads" if heads else "tails")
        return state

    return solve


@task
def coins():
    """Return a task of `TASKS` samples, each tried `TRIES` times."""
    samples = [Sample(input="toss", target="heads", id=f"task-{n:03d}") for n in range(TASKS)]
    return Task(dataset=MemoryDataset(samples), solver=coin(), scorer=match(), epochs=TRIES)


def measured(name, **options):
    """Return the name, CPU seconds and wall seconds of one run."""
    with tempfile.TemporaryDirectory() as folder:
        cpu, wall = time.process_time(), time.perf_counter()
        (log,) = eval(coins(), model="mockllm/model", log_dir=folder, display="none", **options)
        cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
        if log.status != "success":
            raise SystemExit(f"Inspect did not succeed: {log.error}")
    return name, cpu, wall


os.environ["INSPECT_TRACE_FILE"] = os.devnull
measured("warm-up", limit=5)
rows = [
    measured("Inspect"),
    measured("Inspect, no realtime log", log_realtime=False),
    measured("  nor samples in the log", log_realtime=False, log_samples=False),
]
print(json.dumps(rows))  # noqa: T201
