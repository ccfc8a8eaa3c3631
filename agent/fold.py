"""Folds the events of a log into its state: messages, world, settings, and the steps of undo."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..tools.context import Artefacts, Settings
from ..tools.errors import InputError
from ..tools.world import Step, World
from ..tools.world_changes import after_turns, with_changes
from .messages import HISTORY, History, paired
from .report import Since
from .store.protocol import Event

GOES_ON = ("turn", "resume", "message")
"""Events after which a turn that had ended is under way again."""


@dataclass(frozen=True)
class State:
    """The state that the events of a log fold into.

    Attributes:
        facts: what the session began with: model, prompts, limits, policy, picture.
        words: the person's words in the last turn.
        began: the world when that turn began.
        steps: the steps that undo went through at that time.
        seconds: how long that turn has run, without pauses.
        end: how it ended; None if it was killed.
        since: what a deployment beside the session has done after that.
    """

    facts: Mapping[str, Any]
    settings: Settings
    words: str
    world: World
    began: World
    steps: tuple[Step, ...]
    messages: History
    seconds: float
    end: Mapping[str, Any] | None
    since: Since | None


def stepped(steps: tuple[Step, ...], before: int, step: Step, undone: int) -> tuple[Step, ...]:
    """Return the steps that undo goes through after a turn; one that took steps back adds none.

    Args:
        before: how many steps were taken back when the turn began.
        step: the step at the turn's end.
        undone: how many steps were taken back at the turn's end.
    """
    if undone or step.current in (None, steps[-1].current):
        return steps
    return (*steps[: len(steps) - before], step)


def fold(events: Sequence[Event], artefacts: Artefacts) -> State:
    """Return the state after all events.

    Raises:
        InputError: nothing was said, a picture of a message is missing, or plans were altered.
        ValidationError, KeyError, TypeError, ValueError: the events are damaged.
    """
    facts = events[0].data
    start = World.model_validate({"picture": facts["picture"]["facts"]})
    turns: list[list[Mapping[str, Any]]] = []
    said: Mapping[str, Any] = {}
    end = None
    lines: list[Mapping[str, Any]] = []
    seconds = last = 0.0
    for event in _begun(events[1:]):
        if event.kind in ("turn", "resume"):
            seconds = 0.0 if event.kind == "turn" else seconds + last
        last = event.seconds
        if event.kind == "turn":
            said = event.data
            turns.append([])
        elif event.kind == "picture":
            facts = {**facts, "picture": event.data}
        elif event.kind == "world":
            turns[-1].append(event.data["changes"])
        elif event.kind == "message":
            lines.append(event.data)
        end = event.data if event.kind == "end" else end
        end = None if event.kind in GOES_ON else end
    if not said.get("words"):
        raise InputError("It was broken off before anything began; run again.")
    settings = Settings.model_validate(said["settings"])
    if approved := _approved(events):
        settings = settings.model_copy(update={"approved": approved})
    began, steps = _steps_before(start, turns)
    world = with_changes(began, *turns[-1])
    latest = [name for name in (world.current, *list(world.plans)[-1:]) if name]
    if any(world.plans[name].plan.id != name for name in latest):  # others are checked when used
        raise InputError("Its plans were altered after formup wrote them; make them again.")
    messages = paired(read_messages(lines, artefacts))
    words, spent, since = said["words"], seconds + last, _since(events)
    return State(facts, settings, words, world, began, steps, messages, spent, end, since)


def _approved(events: Sequence[Event]) -> str | None:
    """Return the plan whose approval still counts: what goes on after an end needs another."""
    approved: str | None = None
    for event in events:
        if event.kind in ("turn", "end"):
            approved = None
        elif event.kind == "approval":
            approved = event.data["plan_id"] or approved
    return approved


def _steps_before(
    start: World, turns: Sequence[Sequence[Mapping[str, Any]]]
) -> tuple[World, tuple[Step, ...]]:
    """Return the world when the last turn began, and the steps that undo went through then.

    The first step is what there was at the first words, before anything was planned.
    """
    said, *rest = turns[0][:1], turns[0][1:], *turns[1:]
    began, ends = after_turns(start, [said, *rest[:-1]])
    (first, undone), *later = ends
    steps = (first,)
    for step, now in later:
        steps, undone = stepped(steps, undone, step, now), now
    return began, steps


def _since(events: Sequence[Event]) -> Since | None:
    """Return what a deployment beside the session has done since the last turn ended."""
    since: Since | None = None
    over = False
    for event in events:
        if event.kind in GOES_ON:
            over, since = False, None
        elif event.kind == "end":
            over = True
        elif over and event.kind == "moving":
            since = "begun"
        elif since and event.kind == "world" and "arrivals" in event.data["changes"]:
            since = "ended"
    return since


def _begun(events: Sequence[Event]) -> Sequence[Event]:
    """Return the events without turns that were broken off before their first message."""
    kept: list[Event] = []
    turn: int | None = None
    for event in events:
        if event.kind == "turn":
            if turn is not None:
                del kept[turn:]
            turn = len(kept)
        elif event.kind == "message":
            turn = None
        kept.append(event)
    return kept[:turn]


def read_messages(lines: Sequence[Mapping[str, Any]], artefacts: Artefacts | None) -> History:
    """Return messages from the data of their events; without artefacts images are left out.

    Raises:
        StorageError: an image is missing, or not what it was.
        ValidationError: the data are no messages.
    """
    found: list[dict[str, Any]] = []
    for line in lines:
        images = [artefacts.get(i["sha256"]) for i in line["images"]] if artefacts else []
        facts = {k: v for k, v in line.items() if k != "images"}
        found.append(facts | ({} if line["role"] == "assistant" else {"images": images}))
    return HISTORY.validate_python(found)
