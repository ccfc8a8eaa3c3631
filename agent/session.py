"""A session: an event log and what it folds into, messages, world and settings, turn by turn.

A turn lasts from the person's words until the loop has answered, paused or stopped. Whatever
happens is recorded before anything follows from it, so that the log opens again after a kill.
"""

import gc
import io
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypedDict

from pydantic import ValidationError

from ..tools.builtin.motions import ways_ahead
from ..tools.context import Artefacts, Context, Services, Settings
from ..tools.draw import draw_plan, draw_view
from ..tools.errors import InputError, StorageError
from ..tools.formation.plan import Plan
from ..tools.perception.image import Picture, load_picture, picture_file, picture_from_file
from ..tools.perception.target_prompt import TargetPrompt
from ..tools.world import Step, Target, World
from .answers import says_yes
from .calls import refused
from .first_message import check_text
from .fold import State, fold, stepped
from .loop import Approval
from .messages import Message, Reply, Result, unanswered
from .outcomes import Answered, Cancelled, Outcome, Paused, Stopped
from .report import Report, make_report
from .session_start import read_session
from .store.folder import log_path
from .store.folder_store import FolderSession
from .store.protocol import StoredSession

Show = Callable[[Message], None]


class SayOptions(TypedDict, total=False):
    """Options of any turn; see `Agent.asay`."""

    pointed: Sequence[TargetPrompt]
    keep_out: Sequence[TargetPrompt]
    settings: Settings | None
    show: Show | None


class TurnOptions(SayOptions, total=False):
    """Options of a later turn; see `Agent.asay`."""

    picture: Picture | None


class RunOptions(SayOptions, total=False):
    """Options of the first turn; see `Agent.arun`."""

    targets: Sequence[Target]
    trace: Path | StoredSession | None
    begun: int
    services: Services | None


@dataclass(frozen=True, repr=False)
class Run:
    """A session as far as its last turn has come.

    Attributes:
        report: what came of that turn.
        outcome: how it ended, with the messages and the world.
        context: with the world, the settings and the services to go on with.
        began: the world when the turn began.
        stored: the stored session it is written to, if any.
        events: how many events the log had then; this run does not write to a log that has gone on
            since. None if the log could no longer be written.
    """

    report: Report
    outcome: Outcome
    context: Context
    began: World
    stored: StoredSession | None = None
    events: int | None = 0

    @property
    def trace(self) -> Path | None:
        """The path of the log, if it is a file."""
        return self.stored.path if isinstance(self.stored, FolderSession) else None

    @property
    def world(self) -> World:
        """All that is known and decided."""
        return self.outcome.world

    def __repr__(self) -> str:
        """Return a short form, since a run holds the whole conversation."""
        return f"Run({self.report.status!r}, plan_id={self.report.plan_id!r})"

    def _repr_png_(self) -> bytes | None:
        """Return a picture of the reported plan for notebooks, if there is one."""
        plan, file = self._plan, io.BytesIO()
        if plan is None:
            return None
        title = self.report.instruction
        ways = ways_ahead(self.context, self.world, plan)
        drawn = draw_plan(self.context.picture, self.world, plan, title, ways=ways)
        drawn.save(file, "PNG")
        return file.getvalue()

    def view(self) -> bytes | None:
        """Return a JPEG file, 1,024 px long or little more, of what a question offers, else of an
        outline that is doubted, else of the reported plan, if there is one."""
        picture, world, plan = self.context.picture, self.world, self._plan
        if asked := [choice["id"] for choice in self.report.candidates or ()]:
            targets = tuple(t for t in world.targets if t.id in asked)
            others = [self.context.candidate(n) for n in asked if n not in {t.id for t in targets}]
            return draw_view(picture, world.having(targets=targets), candidates=others)
        if world.doubted is not None:
            return draw_view(picture, world.with_doubted())
        return None if plan is None else draw_view(picture, world, plan=plan)

    @property
    def _plan(self) -> Plan | None:
        """The plan that is reported, unless it is void."""
        node = self.world.plans.get(self.report.plan_id or "")
        return None if node is None or self.world.is_void(node.plan) else node.plan

    @property
    def steps(self) -> tuple[Step, ...]:
        """The steps that undo goes through, including that of this turn."""
        world = self.world
        return stepped(self.context.steps, self.began.undone, world.step, world.undone)


@contextmanager
def _no_collections() -> Generator[None]:
    """Suspend garbage collection: a long session is a million values, none of them garbage."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


@_no_collections()
def load_run(
    source: str | Path | StoredSession,
    picture: Picture | None = None,
    services: Services | None = None,
) -> Run:
    """Load a session from its log, as far as it had come: paused, stopped or killed midway.

    Args:
        source: the path of a log or of the folder with a trace.jsonl, or a session in a store.
        picture: its picture; None for the one stored with the log, or else at its original path.
        services: what tools use beside the world; made anew if left out.

    Raises:
        InputError: the log cannot be read, or the picture is not the same.
    """
    stored = FolderSession(log_path(Path(source))) if isinstance(source, str | Path) else source
    artefacts = stored.artefacts
    try:
        events = read_session(stored)
        state = fold(events, artefacts)
        outcome = _outcome(state)
        prompt, prompts = state.facts["prompt"], tuple(state.facts["prompts"])
    except StorageError:
        raise
    except InputError as error:
        raise InputError(f"{stored.label}: {error}") from None
    except (ValidationError, KeyError, TypeError, ValueError, IndexError, AttributeError):
        damaged = f"{stored.label} is damaged; it is no whole session that formup wrote."
        raise InputError(damaged) from None
    services, seen = (
        services or Services(),
        stored_picture(state.facts["picture"], artefacts, picture),
    )
    services.pictures[seen.sha256], services.artefacts = seen, artefacts
    context = Context(state.world, services, state.settings, state.words, steps=state.steps).check()
    model = model_name(state.facts)
    report = make_report(outcome, context, state.began, model, state.seconds, state.since)
    report = report.model_copy(update={"prompt": prompt, "prompts": prompts})
    return Run(report, outcome, context, state.began, stored, len(events))


def prompt_name(facts: Mapping[str, Any] | None) -> str | None:
    """Return `id@vNNN` or `id@draft-NAME` for a prompt as logs and reports have it."""
    if facts is None:
        return None
    version = facts["version"]
    return f"{facts['id']}@{version if isinstance(version, str) else f'v{version:03d}'}"


def model_name(facts: Mapping[str, Any]) -> str:
    """Return the name of the model or, joined by a plus, of the two that shared the work."""
    return "+".join(filter(None, (str(facts["model"]), facts.get("planner"))))


def picture_facts(picture: Picture, artefacts: Artefacts) -> dict[str, Any]:
    """Store a log's picture with it, and return what the log says of the picture."""
    return {
        "facts": World.of(picture).picture.model_dump(),
        "name": picture.name,
        "path": picture.path and str(picture.path),
        "file": artefacts.put(picture_file(picture)),
    }


def stored_picture(
    facts: Mapping[str, Any], artefacts: Artefacts, given: Picture | None
) -> Picture:
    """Return the picture of a session, with the very content it began with.

    Raises:
        InputError: the picture is gone, or the one given is another.
    """
    wanted = facts["facts"]["sha256"]
    if given is None:
        try:
            data = artefacts.get(facts["file"])
            given = picture_from_file(data, facts["name"], wanted)
            given = replace(given, path=facts["path"] and Path(facts["path"]))
        except StorageError:
            if facts["path"] is None or not Path(facts["path"]).is_file():
                raise InputError(
                    f"The picture {facts['name']} is neither beside the log nor where it lay; "
                    "give it as the image."
                ) from None
            given = load_picture(facts["path"])
    if given.sha256 != wanted:
        raise InputError(
            f"{given.path or given.name} is not the picture this was made for, or it has changed "
            "since, which voids its targets and plans; run again on the new picture."
        )
    return given


def with_confirmed_outline(world: World, messages: Sequence[Message], answer: Result) -> World:
    """Return the world after an answer; a yes to a doubtful outline shown makes it a target."""
    last = next((m for m in reversed(messages) if isinstance(m, Result)), None)
    asked = last is not None and last.cause == "low_confidence"
    if world.doubted is None or not asked or not says_yes(answer.text):
        return world
    return world.with_doubted().having(doubted=None)


def answered_by(
    run: Run, answer: str | None, approve: bool | None
) -> tuple[Result | None, Approval | None]:
    """Return the result that a person's answer adds to the history, and the approval it gives.

    Raises:
        InputError: the turn is over, or waits for something else.
    """
    outcome = run.outcome
    if answer is not None and answer.strip():
        check_text("answer", answer, "say it in words")
    if not isinstance(outcome, Paused):
        if answer is not None or approve is not None:
            raise InputError(f"The run asked nothing: it is {run.report.status}.")
        if isinstance(outcome, Answered):
            raise InputError(
                f"The run is over: it is {run.report.status}; say what to do next, such as "
                '"and now the other one".'
            )
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
        return None, Approval(call, outcome.plan_id)
    why = f": {answer.strip()}" if answer and answer.strip() else "."
    return refused(call, f"A person said no{why}"), None


def _outcome(state: State) -> Outcome:
    """Return how a turn ended or was left; one that was killed counts as cancelled."""
    messages, world, end = state.messages, state.world, state.end
    last = messages[-1] if messages else None
    if isinstance(last, Reply) and not last.calls:
        return Answered(messages, world, last.text)
    if isinstance(last, Result) and last.message is not None:
        return Answered(messages, world, last.message)
    if end is None or end["outcome"] == "cancelled":
        return Cancelled(messages, world)
    if end["outcome"] == "paused":
        return Paused(messages, world, unanswered(messages)[0], end["plan_id"])
    if end["outcome"] == "stopped":
        return Stopped(messages, world, end["kind"], end["reason"])
    raise ValueError


def end_facts(outcome: Outcome, report: Report) -> dict[str, Any]:
    """Return the data of the event that ends a turn."""
    facts = {
        "outcome": type(outcome).__name__.lower(),
        "status": report.status,
        "message": report.message,
        "usage": report.usage.model_dump(),
    }
    if isinstance(outcome, Stopped):
        facts |= {"kind": outcome.kind, "reason": outcome.reason}
    if isinstance(outcome, Paused):
        facts |= {"call": outcome.call.id, "plan_id": outcome.plan_id}
    return facts
