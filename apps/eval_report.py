"""`formup eval report`: a run, or two side by side, as one HTML file to open anywhere."""

from pathlib import Path

from ..evals.experiments.journal import read_rows
from ..evals.report.page import page
from ..evals.report.run_folder import Side, side
from ..prompts import PromptLibrary
from ..tools.errors import InputError
from ..tools.store import write_whole
from . import eval_options as e
from . import options as o
from .eval_compare import arm_rows
from .terminal import say

NAME = "report.html"


def report(
    run: e.ReportedRun,
    against: e.Against = None,
    arm_a: o.OldArm = None,
    arm_b: o.NewArm = None,
    out: e.PageFile = None,
    prompts: o.PromptsFolder = None,
) -> None:
    """Write a run as one HTML file.

    It has counts by slice, pictures with robots and misses, and transcripts. With --against, RUN is
    A and the other run B, side by side with their difference and that of their prompts. Held-out
    tasks show only their scores.
    """
    path = out or run / NAME
    sides = _sides(run, against, arm_a, arm_b)
    write_whole(path, page(sides, PromptLibrary(prompts)).encode())
    say(path)


def _sides(run: Path, against: Path | None, arm_a: str | None, arm_b: str | None) -> list[Side]:
    if against is None:
        if arm_b is not None:
            raise InputError("--arm-b needs --against RUN, which names the other run.")
        rows = read_rows(run) if arm_a is None else arm_rows(run, arm_a, "--arm-a")
        if not rows:
            raise InputError(f"{run} holds no trials yet.")
        return [side(run, rows)]
    a, b = arm_rows(run, arm_a, "--arm-a"), arm_rows(against, arm_b, "--arm-b")
    return [side(run, a, "A"), side(against, b, "B")]
