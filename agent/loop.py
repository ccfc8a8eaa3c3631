"""The loop: answer the calls, check the limits, ask the model, append; nothing else."""

import asyncio
from collections.abc import Generator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace

from ..tools.context import Context
from ..tools.errors import ApprovalError, ArgumentsError, FleetError, ModelError
from ..tools.tool import Tool
from ..tools.world import World
from .calls import BrokenToolError, answer, failed, refused, tool_named
from .compaction import compacted
from .limits import DEFAULT_LIMITS, Limits, calls_exhausted, exhausted
from .messages import (
    Call,
    History,
    Message,
    Reply,
    Result,
    failed_before,
    is_repeated,
    known_doubts,
    plan_of_reply,
    unanswered,
)
from .model import Model, Request, reply_in_time
from .outcomes import Answered, Cancelled, Outcome, Paused, Stopped
from .policy import Decision, Policy
from .wrappers.model_finder import ModelFinder

ANYTHING = Policy()


class Recorder:
    """Receives what happens, as it happens; this one records nothing."""

    async def message(self, message: Message, world: World) -> None:
        """Record a new message, and the world after it."""

    async def moving(self, plan_id: str, world: World) -> None:
        """Record that robots are about to move to a plan; raising keeps them where they are."""


@dataclass(frozen=True)
class Approval:
    """A person's yes to one call and, where it moves robots, to the one plan it is for."""

    call: Call
    plan_id: str | None = None


@dataclass
class Conversation:
    """The messages and the world so far, which outlast whatever happens to the loop."""

    messages: History
    world: World
    recorder: Recorder

    async def add(self, message: Reply | Result) -> None:
        """Append a message and record it."""
        self.messages = (*self.messages, message)
        await self.recorder.message(message, self.world)

    def keep(self, world: World) -> None:
        """Put the next world in place."""
        self.world = world

    async def moving(self, plan_id: str) -> None:
        """Record that robots are about to move."""
        await self.recorder.moving(plan_id, self.world)


@dataclass(frozen=True)
class Turn:
    """What stays the same throughout a turn."""

    model: Model
    tools: tuple[Tool, ...]
    offered: tuple[Tool, ...]
    context: Context
    system: str
    limits: Limits
    policy: Policy
    approved: Approval | None

    def permit(self, call: Call, history: History) -> Decision:
        """Return the policy's decision; nobody is asked about a call that cannot be made."""
        tool = tool_named(self.tools, call.name)
        if tool is None or (decision := self.policy.decide(tool)) == "allow":
            return "allow"
        if decision == "refuse":
            return "refuse"
        if self.approved == Approval(call, self.plan_of(call, history)):
            return "allow"
        try:
            tool.parse(call.arguments)
        except ArgumentsError:
            return "allow"
        return "ask"

    def moves(self, call: Call) -> bool:
        """Return whether a call moves robots."""
        tool = tool_named(self.tools, call.name)
        return tool is not None and tool.kind == "actuate"

    def plan_of(self, call: Call, history: History) -> str | None:
        """Return the id of the plan that a call which moves robots is for; None for others."""
        named = call.arguments.get("plan_id") or plan_of_reply(history)
        return str(named) if self.moves(call) and named else None

    async def ask(self, messages: History) -> Reply:
        """Return the model's next reply, complete and in time."""
        sent = messages if getattr(self.model, "reads_all", False) else compacted(messages)
        request = Request(self.system, sent, self.offered)
        return await reply_in_time(self.model, request, self.limits.reply_seconds)


async def run(
    model: Model,
    tools: tuple[Tool, ...],
    context: Context,
    messages: History,
    *,
    system: str = "",
    offered: tuple[Tool, ...] | None = None,
    limits: Limits = DEFAULT_LIMITS,
    policy: Policy = ANYTHING,
    approved: Approval | None = None,
    recorder: Recorder | None = None,
) -> Outcome:
    """Run a turn until it is answered, paused, stopped or cancelled.

    Args:
        context: with the current world; the outcome has the resulting one.
        messages: the history so far; unanswered calls at its end are answered first. The turn
            begins with the person's last message.
        system: the prompt.
        offered: the tools that the model is offered; None for all. It may call the others too.
        limits: limits of the turn.
        policy: which calls go ahead.
        approved: the call that a person has said yes to.
        recorder: receives every new message.
    """
    talk = Conversation(messages, context.world, recorder or Recorder())
    shown = tools if offered is None else offered
    turn = Turn(model, tools, shown, context, system, limits, policy, approved)
    clock = asyncio.timeout(limits.seconds)
    try:
        async with clock:
            return await _converse(turn, talk, clock)
    except asyncio.CancelledError:
        return Cancelled(talk.messages, talk.world)
    except TimeoutError:
        if not clock.expired():
            raise
        reason = f"The limit of {limits.seconds:g} s was reached."
        return Stopped(talk.messages, talk.world, "limit", reason)
    except BrokenToolError as error:
        return Stopped(talk.messages, talk.world, "tool", str(error), error.__cause__)
    except ModelError as error:
        return Stopped(talk.messages, talk.world, "model", str(error))
    except FleetError as error:
        return Stopped(talk.messages, talk.world, "fleet", str(error))


async def _converse(turn: Turn, talk: Conversation, clock: asyncio.Timeout) -> Outcome:
    while True:
        for call in unanswered(talk.messages):
            if outcome := await _settle(turn, talk, call, clock):
                return outcome
        if reason := exhausted(talk.messages, turn.limits):
            return Stopped(talk.messages, talk.world, "limit", reason)
        reply = await turn.ask(talk.messages)
        await talk.add(reply)
        if not reply.calls:
            return Answered(talk.messages, talk.world, reply.text)


async def _settle(
    turn: Turn, talk: Conversation, call: Call, clock: asyncio.Timeout
) -> Outcome | None:
    """Answer one call; return how that ends the turn, or None."""
    if reason := calls_exhausted(talk.messages, turn.limits):
        return Stopped(talk.messages, talk.world, "limit", reason)
    before = failed_before(talk.messages)
    decision = "skip" if before and turn.moves(call) else turn.permit(call, talk.messages)
    if decision == "ask":
        await _store_choices(turn, talk, call)
        return Paused(talk.messages, talk.world, call, turn.plan_of(call, talk.messages))
    if decision == "skip":
        await talk.add(failed(call, "skipped", f"Not done, because {before} before it failed."))
        return None
    if decision == "refuse":
        await talk.add(refused(call, f"{call.name} may not be called here; do without it."))
        return _turn_end(talk)
    context = replace(
        turn.context,
        world=talk.world,
        doubted=known_doubts(talk.messages),
        proposed=plan_of_reply(talk.messages),
        agreed=turn.approved is not None and turn.approved.call == call,
        observed=talk.keep,
        moving=talk.moving,
    )
    try:
        with _clock_stopped(clock) if turn.moves(call) else nullcontext():
            result = await answer(turn.tools, context, call, turn.limits.tool_seconds)
    except ApprovalError as needed:
        return Paused(talk.messages, talk.world, call, needed.plan_id)
    if isinstance(turn.context.asks, ModelFinder):
        result = result.model_copy(update={"asides": turn.context.asks.taken()})
    await talk.add(result)
    return _turn_end(talk)


async def _store_choices(turn: Turn, talk: Conversation, call: Call) -> None:
    """Put what a question offers into the world, so that its ids mean the same in the answer."""
    tool = tool_named(turn.tools, call.name)
    if tool is not None and tool.kind == "ask":
        context = replace(turn.context, world=talk.world, observed=talk.keep)
        await answer(turn.tools, context, call, turn.limits.tool_seconds)


@contextmanager
def _clock_stopped(clock: asyncio.Timeout) -> Generator[None, None, None]:
    """Stop the turn's clock while robots drive."""
    now, ends = asyncio.get_running_loop().time, clock.when()
    left = None if ends is None else ends - now()
    clock.reschedule(None)
    try:
        yield
    finally:
        if not clock.expired():
            clock.reschedule(None if left is None else now() + left)


def _turn_end(talk: Conversation) -> Outcome | None:
    """Return how the last result ends the turn (done, or the model repeats itself), or None."""
    result = talk.messages[-1]
    assert isinstance(result, Result)
    if result.message is not None:
        return Answered(talk.messages, talk.world, result.message)
    if is_repeated(talk.messages):
        what = "a failing call to" if result.error else "the same call to"
        reason = f"The model repeated {what} {result.name}: {result.text}"
        return Stopped(talk.messages, talk.world, "repeat", reason)
    return None
