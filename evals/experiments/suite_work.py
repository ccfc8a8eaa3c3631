"""The work on a trial of a suite: run, grade and store it; another process can be given it.

A provider that fails is an infrastructure error and says nothing about the model; output that
cannot be used is the model's failure, counted separately.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ...agent.agent import Agent, Run
from ...agent.messages import Result
from ...agent.outcomes import Answered, Stopped
from ...tools.context import Settings
from ...tools.perception.image import Picture, load_picture
from ...tools.store import write_whole
from ..grading.attempts import Attempt, grade_attempt
from ..grading.dialogue import summary
from ..grading.grades import VERSION, Graded
from ..grading.policies import POLICIES, positions
from ..rl.policy import RL, places
from ..tasks.task import Dialogue, Task
from .dialogue_work import DialogueRecord, hold
from .methods import WRITERS, Method
from .pointing import Pointing, pointing
from .recordings import file_name, recordings
from .seals import files_hash
from .segment_only import SEGMENT_ONLY
from .simulated_model import SIMULATED
from .tokens import spent
from .trials import Status, Trial, TrialRow, Turns, canonical
from .written import declined, written_positions

LONGEST = 400
"""Most characters of feedback in a row."""


@dataclass(frozen=True)
class SuiteWork:
    """Runs and grades one trial.

    Attributes:
        tasks: by id.
        pictures: files, by the task's id.
        arms: methods by the name of the arm in a trial.
        attempts: a folder for what was planned and observed, for viewing and grading again; None
            if only scores may be seen.
    """

    tasks: Mapping[str, Task]
    pictures: Mapping[str, Path]
    arms: Mapping[str, Method]
    attempts: Path | None = None

    def __call__(self, trial: Trial) -> TrialRow:
        """Run and grade a trial, and return its row."""
        task, arm = self.tasks[trial.task], self.arms[trial.arm.name]
        if task.dialogue is not None:
            return self._dialogue(task, task.dialogue, arm, trial)
        if arm.name in POLICIES or arm.name == RL:
            attempt, run, cost = _by_policy(task, arm, trial), None, {}
        else:
            run, cost = self._run(task, arm, trial)
            lost = _lost(run)
            if lost is not None:
                return TrialRow.of(trial, "infra_error", feedback=lost, **cost)
            attempt = _attempt(run, arm)
        graded = grade_attempt(task.goals, task.expects, attempt)
        status: Status = "pass" if graded.sr else "fail"
        if run is not None and not graded.sr and _invalid(run, arm, attempt):
            status = "model_invalid"
        if self.attempts is not None:
            _write(self.attempts / f"{attempt_name(trial)}.json", attempt, graded, run)
        return TrialRow.of(
            trial,
            status,
            outcome=attempt.status,
            gcr=graded.gcr,
            strict=graded.strict,
            object_correct=graded.object_correct,
            iou=graded.iou,
            e95=graded.e95,
            feedback=graded.feedback[:LONGEST] if self.attempts is not None else "",
            files=self._kept(trial),
            **cost,
        )

    def _run(self, task: Task, arm: Method, trial: Trial) -> tuple[Run, dict[str, Any]]:
        """Return the run of a trial and what it cost."""
        agent, settings, shown, trace = self._begin(task, arm, trial)
        run = agent.run(
            _picture(self.pictures[task.id]),
            task.instruction,
            pointed=shown.pointed,
            targets=shown.targets,
            settings=settings,
            trace=trace,
        )
        return run, _cost([run], agent, arm)

    def _dialogue(self, task: Task, dialogue: Dialogue, arm: Method, trial: Trial) -> TrialRow:
        """Return the row of a dialogue: it succeeds if every turn does; gcr is their share."""
        agent, settings, shown, trace = self._begin(task, arm, trial)
        picture = _picture(self.pictures[task.id])
        held = hold(agent, picture, task, settings, shown, trace)
        cost = _cost(held.runs, agent, arm)
        lost = next(filter(None, map(_lost, held.runs)), None)
        if lost is not None:
            return TrialRow.of(trial, "infra_error", feedback=lost, **cost)
        if self.attempts is not None:
            _write_dialogue(self.attempts / f"{attempt_name(trial)}.json", held, dialogue)
        grades = held.grades
        right = sum(not grade.problems for grade in grades)
        done = right == len(grades)
        still = [grade for grade in grades if grade.still]
        return TrialRow.of(
            trial,
            "pass" if done else "fail",
            outcome=held.states[-1].status,
            gcr=right / len(grades),
            strict=done,
            feedback=summary(grades, dialogue.turns) if self.attempts else "",
            turns=Turns(
                total=len(grades),
                right=right,
                still=len(still),
                kept=sum(grade.kept for grade in still),
            ),
            files=self._kept(trial),
            **cost,
        )

    def _kept(self, trial: Trial) -> str | None:
        """Return the hash of the files stored of a trial; None if nothing is stored."""
        return self.attempts and files_hash(attempt_files(self.attempts, trial))

    def _begin(
        self, task: Task, arm: Method, trial: Trial
    ) -> tuple[Agent, Settings, Pointing, Path | None]:
        """Return a trial's agent, its settings, what is pointed at, and the file of its trace."""
        seed, recording, recorded = trial.seed, None, recordings(arm.model)
        if recorded and (recording := recorded.of(task.id, trial.trial)):
            seed = recorded.seed(recording)
        settings = Settings(
            robots=task.robots,
            descriptor=arm.descriptor,
            seed=seed,
            metres_per_pixel=task.metres_per_pixel,
            segmenter=arm.model if arm.name == SEGMENT_ONLY else arm.segmenter,
        )
        trace = None
        if self.attempts is not None and arm.model not in ("offline", SIMULATED):
            trace = self.attempts / f"{attempt_name(trial)}.jsonl"
        shown = pointing(task, arm.mode, trial.trial)
        return arm.agent(trial.seed, recording), settings, shown, trace


def attempt_name(trial: Trial) -> str:
    """Return the name of a trial's files: its result (.json) and its trace (.jsonl)."""
    return f"{file_name(trial.task)}-{trial.trial}-{trial.key[:12]}"


def attempt_files(folder: Path, trial: Trial) -> tuple[Path, Path]:
    """Return the paths of a trial's result and of its trace, whether or not they exist."""
    name = attempt_name(trial)
    return folder / f"{name}.json", folder / f"{name}.jsonl"


def _by_policy(task: Task, arm: Method, trial: Trial) -> Attempt:
    """Return the attempt of a policy, which moves robots even if nothing is to be placed."""
    placed = [(0.0, 0.0)]
    if arm.name == RL:
        found = places(Path(arm.model), task.category, task.goals, trial.trial, trial.seed)
        placed = found.tolist()
    elif task.goals:
        placed = positions(arm.name, task.goals, trial.seed).tolist()
    return Attempt("deployed", placed, placed)


def _attempt(run: Run, arm: Method) -> Attempt:
    report = run.report
    targets, contract = run.world.targets, report.contract
    measured = tuple(t.outline.polygon for t in targets)
    if arm.name in WRITERS:
        written, refusal = written_positions(report.message), declined(report.message)
        if written is None and refusal:
            return Attempt(refusal, message=report.message, declined=True, measured=measured)
        placed = written and arm.frame.pixels(written, run.world.picture.size)
        status = "deployed" if placed else "failed"
        return Attempt(status, placed, placed, measured, measured, report.message)
    given_up = isinstance(run.outcome, Answered) and isinstance(run.outcome.messages[-1], Result)
    named = contract.target_ids if contract else ()
    return Attempt(
        status=report.status,
        planned=report.positions,
        observed=report.arrival and report.arrival.observed,
        found=tuple(t.outline.polygon for t in targets if t.id in named),
        measured=measured,
        message=report.message,
        declined=report.status == "question" or (report.status == "impossible" and given_up),
    )


def _lost(run: Run) -> str | None:
    """Return why a run says nothing about the model, if something else has failed."""
    outcome = run.outcome
    if isinstance(outcome, Stopped) and outcome.kind in ("model", "tool", "fleet"):
        return f"{outcome.kind}: {outcome.reason}"[:LONGEST]
    return None


def _invalid(run: Run, arm: Method, attempt: Attempt) -> bool:
    """Return whether there is nothing to judge: no call that could be made, no positions."""
    if attempt.observed is not None or attempt.declined:
        return False
    if arm.name in WRITERS:
        return True
    results = [m for m in run.outcome.messages if isinstance(m, Result)]
    return not results or results[-1].error in ("unknown_tool", "arguments")


def _cost(runs: Sequence[Run], agent: Agent, arm: Method) -> dict[str, Any]:
    """Return tokens as the provider counts them, else by rule of thumb; rules take none.

    Args:
        runs: one, or all turns of a dialogue.
    """
    usage = [run.report.usage for run in runs]
    if arm.model == "offline":
        return {"requests": sum(u.requests for u in usage)}
    guess = spent(runs[-1].outcome.messages, agent.system, agent.offered)
    counted = arm.model != SIMULATED and recordings(arm.model) is None
    return {
        "requests": sum(u.requests for u in usage),
        "input_tokens": sum(u.input_tokens for u in usage) if counted else guess.input,
        "output_tokens": sum(u.output_tokens for u in usage) if counted else guess.output,
        "cached_tokens": guess.cached,
        "cost_usd": sum(u.cost_usd for u in usage) if counted else 0.0,
    }


def _write(path: Path, attempt: Attempt, graded: Graded, run: Run | None) -> None:
    verdict = run and run.report.verdict
    content = {
        "graders": VERSION,
        "status": attempt.status,
        "message": attempt.message,
        "declined": attempt.declined,
        "planned": attempt.planned,
        "observed": attempt.observed,
        "certified": verdict.certified if verdict else None,
        "confidence": [t.confidence for t in run.world.targets] if run else [],
        "found": [list(polygon.exterior.coords) for polygon in attempt.found],
        "graded": asdict(graded),
    }
    write_whole(path, canonical(content))


def _write_dialogue(path: Path, held: DialogueRecord, dialogue: Dialogue) -> None:
    """Write a dialogue in the form of an attempt: the state at its end, and all turns beside it."""
    last = held.states[-1]
    problems = summary(held.grades, dialogue.turns)
    content = {
        "graders": VERSION,
        "status": last.status,
        "message": problems or last.message,
        "planned": last.positions.tolist(),
        "observed": None,
        "turns": held.as_data(dialogue),
    }
    write_whole(path, canonical(content))


@lru_cache(maxsize=4)
def _picture(path: Path) -> Picture:
    return load_picture(path)
