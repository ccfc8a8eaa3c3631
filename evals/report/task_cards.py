"""Tasks as cards: the picture, what each trial placed on it, its grades, its transcript."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..experiments.trials import TrialRow
from ..tasks.task import Task
from .pictures import PagePicture
from .run_folder import Side, Utterance
from .trial_overlay import Drawing, drawing

WORDS = {"pass": "passed", "fail": "failed", "model_invalid": "invalid", "infra_error": "lost"}


@dataclass(frozen=True)
class TrialPanel:
    """A trial on a card."""

    row: TrialRow
    word: str
    who: str
    drawing: Drawing
    placed: bool
    figures: str
    transcript_title: str
    transcript: Sequence[Utterance]


@dataclass(frozen=True)
class Card:
    """A task with its trials."""

    task: Task
    passed: int
    scored: int
    facts: str
    picture_missing: bool
    trials: Sequence[TrialPanel]

    @property
    def failed(self) -> bool:
        """Whether any scored trial failed."""
        return self.passed < self.scored


def cards(sides: Sequence[Side], pictures: Mapping[str, PagePicture]) -> list[Card]:
    """Return a card for each task that was tried, in the suite's order.

    Args:
        sides: one run, or A and B, whose trials are shown next to each other.
        pictures: by the hash of their pixels.
    """
    trials: defaultdict[str, list[tuple[Side, TrialRow]]] = defaultdict(list)
    for side in sides:
        for row in side.rows:
            trials[row.task].append((side, row))
    suite = sides[0].suite
    return [
        _card(task, sorted(trials[task.id], key=_number_and_arm), picture)
        for task in suite.tasks
        if task.id in trials and (picture := pictures[suite.pictures[task.id].pixels])
    ]


def _number_and_arm(trial: tuple[Side, TrialRow]) -> tuple[int, str, str]:
    """Return a sort key that keeps trials of a number together, in the order of arms."""
    side, row = trial
    return row.trial, side.label, row.arm.name


def _card(task: Task, trials: Sequence[tuple[Side, TrialRow]], picture: PagePicture) -> Card:
    scored = [row for _, row in trials if row.scored]
    robots = None if task.robots is None else f"{task.robots} robots"
    expects = None if "deployed" in task.expects else f"right: {' or '.join(task.expects)}"
    facts = (task.category, task.setup, robots, task.style, expects)
    return Card(
        task=task,
        passed=sum(bool(row.sr) for row in scored),
        scored=len(scored),
        facts=" · ".join(filter(None, facts)),
        picture_missing=not picture.id,
        trials=[_panel(task, side, row, picture) for side, row in trials],
    )


def _panel(task: Task, side: Side, row: TrialRow, picture: PagePicture) -> TrialPanel:
    attempt, transcript = side.attempt(row), side.transcript(row)
    robots, wrong = (len(attempt.observed or ()), attempt.right.count(False)) if attempt else (0, 0)
    title = f"{task.id}, trial {row.trial}: {robots} robots, {wrong} wrong"
    label = f"{side.label}: " if side.label else ""
    message = attempt.message if attempt else ""
    return TrialPanel(
        row=row,
        word=WORDS[row.status],
        who=f"{label}{row.arm.name.removesuffix(' none')}, trial {row.trial}",
        drawing=drawing(task, attempt, picture, title),
        placed=attempt is not None and bool(attempt.observed or attempt.planned),
        figures=_figures(row),
        transcript_title="How it ended" if transcript is None else "Transcript",
        transcript=([Utterance("message", "", message)] if message else [])
        if transcript is None
        else transcript,
    )


def _figures(row: TrialRow) -> str:
    figures = [] if row.gcr is None else [f"GCR {row.gcr:.2f}"]
    figures += ["strict"] if row.strict else []
    figures += ["wrong thing"] if row.object_correct is False else []
    figures += [] if row.iou is None else [f"IoU {row.iou:.2f}"]
    figures += [] if row.e95 is None else [f"e95 {row.e95:.3f}"]
    if row.input_tokens or row.output_tokens:
        figures.append(f"{row.requests} requests")
        figures.append(f"{row.input_tokens:,} in, {row.output_tokens:,} out tokens")
    figures += [f"{row.cost_usd:.4f} USD"] if row.cost_usd else []
    return " · ".join([*figures, f"{row.seconds:.1f} s"])
