"""Tasks as cards: the picture, what each trial placed on it, how it was judged, what was said."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

from ..experiments.journal import Arm
from ..experiments.trials import TrialRow
from ..tasks.stored_suite import KeptTask
from .markup import Html, joined, tag
from .pictures import Shown
from .read import Said, Side
from .trial_overlay import overlay

OPEN = 4
"""Trials of a task that are shown at once; more are opened by hand."""
WORDS = {"pass": "passed", "fail": "failed", "model_invalid": "invalid", "infra_error": "lost"}


def cards(sides: Sequence[Side], shown: Mapping[str, Shown]) -> Html:
    """A card for each task, in the suite's order.

    Args:
        sides: one run, or A and B, whose trials stand next to each other.
        shown: the pictures by the hash of their pixels.
    """
    trials: defaultdict[str, list[tuple[Side, TrialRow]]] = defaultdict(list)
    for side in sides:
        for row in side.rows:
            trials[row.task].append((side, row))
    return joined(
        _card(task, sorted(trials[task.id], key=_order), shown[task.pixels])
        for task in sides[0].suite.tasks
        if task.id in trials
    )


def _order(trial: tuple[Side, TrialRow]) -> tuple[int, str, str]:
    """Trials of a number stand together, in the order of arms."""
    side, row = trial
    return row.trial, side.called, Arm.of(row).name


def _card(task: KeptTask, trials: Sequence[tuple[Side, TrialRow]], picture: Shown) -> Html:
    failed = any(not row.sr for _, row in trials if row.scored)
    scored = [row for _, row in trials if row.scored]
    passed = sum(bool(row.sr) for row in scored)
    panels = [_trial(task, side, row, picture) for side, row in trials]
    more = None
    if len(panels) > OPEN:
        count = tag("summary", _counted(len(panels) - OPEN, "more trial"))
        more = tag("details", count, tag("div", panels[OPEN:], class_="trials"), class_="more")
    robots = "" if task.robots is None else f" · {_counted(task.robots, 'robot')}"
    expects = "" if "deployed" in task.expects else f" · right: {' or '.join(task.expects)}"
    style = f" · {task.style}" if task.style else ""
    missing = None if picture.id else tag("p", "The picture is missing.", class_="note")
    return tag(
        "article",
        tag(
            "header",
            tag("h3", task.id),
            tag("span", f"{passed}/{len(scored)}", class_="bad" if failed else "good"),
            tag("p", task.instruction, class_="words"),
            tag("p", f"{task.category} · {task.setup}{robots}{style}{expects}", class_="note"),
        ),
        missing,
        tag("div", panels[:OPEN], class_="trials"),
        more,
        class_="task",
        data_failed="yes" if failed else "no",
        data_category=task.category,
    )


def _trial(task: KeptTask, side: Side, row: TrialRow, picture: Shown) -> Html:
    kept, word = side.kept(row), WORDS[row.status]
    placed = kept is not None and bool(kept.observed or kept.planned)
    count = len(kept.observed or ()) if kept else 0
    wrong = count - sum(kept.right) if kept else 0
    title = f"{task.id}, trial {row.trial}: {_counted(count, 'robot')}, {wrong} wrong"
    who = " ".join(
        filter(
            None, [f"{side.called}:" if side.called else "", Arm.of(row).name.removesuffix(" none")]
        )
    )
    return tag(
        "section",
        overlay(task, kept, picture, title),
        tag(
            "p",
            tag("strong", word, class_="good" if row.sr else "bad"),
            f" {who}, trial {row.trial}",
            class_="who",
        ),
        None if placed else tag("p", "Nothing was placed.", class_="note"),
        tag("p", row.feedback, class_="feedback") if row.feedback else None,
        tag("p", _figures(row), class_="note"),
        _transcript(side, row, kept.said if kept else ""),
        class_="trial",
    )


def _figures(row: TrialRow) -> str:
    graded = [] if row.gcr is None else [f"GCR {row.gcr:.2f}"]
    graded += ["strict"] if row.strict else []
    graded += ["wrong thing"] if row.object_correct is False else []
    tokens = row.input_tokens, row.output_tokens
    spent = ["{:,} in, {:,} out".format(*tokens) + " tokens"] if any(tokens) else []
    spent += [f"{row.cost_usd:.4f} USD"] if row.cost_usd else []
    return " · ".join([*graded, *spent, f"{row.seconds:.1f} s"])


def _transcript(side: Side, row: TrialRow, said: str) -> Html | None:
    """What was said; of a trial without a trace, what the person was told."""
    spoken, title = side.transcript(row), "Transcript"
    if spoken is None:
        spoken, title = [Said("told", "", said)] if said else [], "What the person was told"
    if not spoken:
        return None
    lines = [
        tag("div", tag("b", line.who, " ", line.tool), tag("pre", line.text, _rest(line)))
        for line in spoken
    ]
    return tag("details", tag("summary", title), lines, class_="transcript")


def _rest(line: Said) -> Html | None:
    if not line.left_out:
        return None
    return tag("i", f"\n{line.left_out:,} more characters are in the trace.")


def _counted(count: int, what: str) -> str:
    return f"{count:,} {what}" if count == 1 else f"{count:,} {what}s"
