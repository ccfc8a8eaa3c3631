"""A run as a value, read back from its trace, and what a person may say for it to go on."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..tools.errors import InputError
from ..tools.perception.image import Picture
from ..tools.store import restore
from ..tools.world import Settings, Workspace
from .calls import refused
from .messages import Call, History, Reply, Result, unanswered
from .outcomes import Answered, Cancelled, Outcome, Paused, StopKind, Stopped
from .report import Report, make_report
from .store.folder import Trace, read_trace

MAX_TEXT = 4_000
"""Characters of what a person says; longer texts are no instruction, and cost their reader."""


@dataclass(frozen=True)
class Run:
    """A run as far as it came: its report, how it ended, what it worked on, its trace."""

    report: Report
    outcome: Outcome
    workspace: Workspace
    trace: Path | None = None


def load_run(path: str | Path, picture: Picture | None = None) -> Run:
    """A run from its trace, as far as it had come: paused, stopped, or killed in the middle.

    Args:
        path: of the trace, or of the folder with a trace.jsonl.
        picture: what it works on, where that came from no file or has been moved.

    Raises:
        InputError: it cannot be read, or the picture is not the same.
    """
    trace = read_trace(Path(path))
    try:
        settings, outcome = _settings(trace), _outcome(trace)
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{trace.path} is damaged: its settings or its end.") from None
    stored, arrivals = trace.state()
    workspace = restore(stored, picture, settings)
    workspace.arrivals.update(arrivals)
    start = trace.start
    workspace.instruction = start["instruction"]
    report = make_report(
        outcome, workspace, start["instruction"], trace.model, round(trace.seconds, 3)
    )
    prompts = tuple(start.get("prompts", ()))
    report = report.model_copy(update={"prompt": start["prompt"], "prompts": prompts})
    return Run(report, outcome, workspace, trace.path)


def going_on(
    run: Run, answer: str | None, approve: bool | None
) -> tuple[Result | None, Call | None]:
    """What a person's word adds to the history, and the call it lets through.

    Raises:
        InputError: the run is over, or waits for something else.
    """
    outcome = run.outcome
    if not isinstance(outcome, Paused):
        if answer is not None or approve is not None:
            raise InputError(f"The run asked nothing: it is {run.report.status}.")
        if isinstance(outcome, Answered):
            raise InputError(f"The run is over: it is {run.report.status}; begin a new one.")
        return None, None
    call = outcome.call
    if call.name == "ask_user":
        if answer is None:
            raise InputError(f"The run waits for an answer: {run.report.message}")
        check_text("answer", answer, "say it in words, or the number of a candidate")
        return Result(call_id=call.id, name=call.name, text=answer.strip()), None
    if approve is None:
        raise InputError(f"{run.report.message} Say yes or no; nothing was done.")
    if approve:
        return None, call
    why = f": {answer.strip()}" if answer and answer.strip() else "."
    return refused(call, f"A person said no{why}"), None


def check_text(name: str, text: str, advice: str) -> None:
    """Refuse what a person says where nobody could read it.

    Raises:
        InputError: empty, no text, or far too long.
    """
    if not text.strip():
        raise InputError(f"The {name} is empty; {advice}.")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(f"The {name} holds bytes that are not text in UTF-8.") from None
    if len(text) > MAX_TEXT:
        raise InputError(f"The {name} has {len(text):,} characters; {MAX_TEXT:,} can be read.")


def _settings(trace: Trace) -> Settings:
    facts = dict(trace.start["settings"])
    starts = facts.pop("starts")
    return Settings(**facts, starts=None if starts is None else np.asarray(starts, float))


def _outcome(trace: Trace) -> Outcome:
    """How a run ended or was left; one that was killed was cancelled from outside."""
    messages, end = trace.messages(), trace.end
    last = messages[-1] if messages else None
    if isinstance(last, Reply) and not last.calls:
        return Answered(messages, last.text)
    if end is None or end["outcome"] == "cancelled":
        return Cancelled(messages)
    if end["outcome"] == "paused":
        return Paused(messages, _waiting(messages, trace))
    if end["outcome"] == "stopped":
        kind: StopKind = end["kind"]
        return Stopped(messages, kind, end["reason"])
    assert isinstance(last, Result)
    return Answered(messages, last.told or last.text)


def _waiting(messages: History, trace: Trace) -> Call:
    calls = unanswered(messages)
    if not calls:
        raise InputError(f"{trace.path} is damaged: it waits for a call that is not there.")
    return calls[0]
