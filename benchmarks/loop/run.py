"""CPU time per turn of agent loops: bare httpx, formup and other frameworks.

`python run.py ROUNDS FOLDER`, with the environments of the other frameworks in FOLDER/NAME. All do
the same exchanges with one scripted server. A round measures each once, in alternating order, and
only ratios within a round count: medians, with quartiles in brackets.
"""

import json
import statistics
import subprocess
import sys
import urllib.request
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
OURS = ("floor", "formup")
PEERS = ("pydantic_ai", "openai_agents", "langgraph", "smolagents")
MUCH_LESS = 4.0
"""Target: other frameworks take this multiple of formup's CPU time, one conversation at a time."""


@dataclass(frozen=True)
class Case:
    """A measurement: conversations of a number of turns, and formup's target.

    Attributes:
        most: target of formup's CPU time, as a multiple of the floor's.
        every: the other frameworks, which are slow, take part in one round of this many; odd,
            so that the order alternates for them as well.
    """

    title: str
    turns: int
    runs: int
    most: float
    every: int
    stream: bool = False
    at_once: bool = False

    @property
    def few(self) -> int:
        """Conversations that suffice for slow frameworks, or to count requests."""
        return self.runs if self.at_once else 1


CASES = (
    Case("8 turns", 8, 6, most=1.1, every=1),
    Case("101 turns", 101, 1, most=1.0, every=9),
    Case("8 turns, streamed", 8, 4, most=1.1, every=1, stream=True),
    Case("101 turns, streamed", 101, 1, most=1.1, every=9, stream=True),
    Case("64 conversations of 8 turns at once", 8, 64, most=1.1, every=9, at_once=True),
)


class Worker:
    """A process that runs one framework."""

    def __init__(self, name: str, python: Path, port: int) -> None:
        self._base = f"http://127.0.0.1:{port}"
        self._final = "f" if name == "smolagents" else ""
        self.process = subprocess.Popen(
            [python, "worker.py", f"run_{name}"],
            cwd=HERE,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._read()

    def cpu(self, case: Case, runs: int) -> float:
        """Hold conversations and return CPU seconds per turn."""
        command = {
            "url": f"{self._base}/t{case.turns - 1}{self._final}/v1",
            "runs": runs,
            "stream": case.stream,
            "at_once": case.at_once,
        }
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(command) + "\n")
        self.process.stdin.flush()
        answer = self._read()
        if "error" in answer:
            raise SystemExit(f"{self.process.args}: {answer['error']}")
        return float(answer["cpu"]) / runs / case.turns

    def _read(self) -> Any:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.process.args} ended; its last words are above.")
        return json.loads(line)


@contextmanager
def started(python: Path, *arguments: str) -> Generator[int]:
    """Start the scripted server and yield its port."""
    command = [python, *arguments]
    with subprocess.Popen(command, cwd=HERE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            yield int(server.stdout.readline())
        finally:
            server.kill()


def check(worker: Worker, name: str, port: int) -> None:
    """Check that a worker does the same exchanges as all others; exit if not."""
    for case in CASES:
        before = _counts(port)
        worker.cpu(case, case.few)
        after = _counts(port)
        asked = after["requests"] - before["requests"]
        if asked != case.turns * case.few or after["bad"]:
            raise SystemExit(f"{name}, {case.title}: {asked} requests, {after['bad']} of them bad.")


def compare(case: Case, workers: dict[str, Worker], rounds: int) -> None:
    """Measure a case and print its table."""
    every = min(case.every, rounds - 1)
    spent: dict[str, dict[int, float]] = {name: {} for name in workers}
    for name in OURS:
        workers[name].cpu(case, case.runs)  # warm
    for number in range(rounds):
        names = [name for name in workers if name in OURS or number % every == 0]
        for name in names if number % 2 else reversed(names):
            runs = case.few if name in PEERS else case.runs
            spent[name][number] = workers[name].cpu(case, runs)
    print(f"\n{case.title} ({rounds} rounds)")  # noqa: T201
    for name, times in spent.items():
        print(_line(name, times, spent, case), flush=True)  # noqa: T201


def _line(
    name: str, times: dict[int, float], spent: dict[str, dict[int, float]], case: Case
) -> str:
    against_floor = _ratio(times, spent["floor"])
    line = f"  {name:14} {1e3 * statistics.median(times.values()):7.2f} ms a turn"
    line += f"  {_shown(against_floor)} x floor"
    if name == "formup":
        line += _verdict(against_floor[1] <= case.most, f"at most {case.most:.1f}")
    if name in PEERS:
        against_us = _ratio(times, spent["formup"])
        line += f"  {_shown(against_us)} x formup"
        if not case.at_once:
            line += _verdict(against_us[1] >= MUCH_LESS, f"at least {MUCH_LESS:.0f}")
        line += f"  in {len(times)} rounds" if case.every > 1 else ""
    return line


def _counts(port: int) -> dict[str, int]:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/counts") as response:
        return json.load(response)


def _ratio(ours: dict[int, float], theirs: dict[int, float]) -> tuple[float, float, float]:
    """Return the quartiles of the ratios within rounds."""
    ratios = [seconds / theirs[number] for number, seconds in ours.items()]
    low, middle, high = statistics.quantiles(ratios, n=4)
    return low, middle, high


def _shown(quartiles: tuple[float, float, float]) -> str:
    low, middle, high = quartiles
    return f"{middle:6.2f} [{low:.2f}-{high:.2f}]"


def _verdict(met: bool, target: str) -> str:
    return f"  ({target}: {'met' if met else 'MISSED'})"


def main() -> None:
    """Run all comparisons."""
    rounds, folder = int(sys.argv[1]), Path(sys.argv[2]).absolute()
    if rounds < 2:
        raise SystemExit(f"{rounds} rounds have no quartiles: ROUNDS must be 2 or more.")
    here = Path(sys.executable)
    pythons = dict.fromkeys(OURS, here) | {p: folder / p / "bin/python" for p in PEERS}
    with started(here, "server.py") as port, ExitStack() as stack:
        workers: dict[str, Worker] = {}
        for name, python in pythons.items():
            workers[name] = Worker(name, python, port)
            stack.callback(workers[name].process.kill)
            check(workers[name], name, port)
        for case in CASES:
            compare(case, workers, rounds)


if __name__ == "__main__":
    main()
