"""The loop: answer the calls, check the limits, ask the model, append; nothing else."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial

from ..tools.errors import ArgumentsError, FleetError, ModelError
from ..tools.tool import Tool
from ..tools.world import Workspace
from .calls import BrokenToolError, answer, failed, refused, tool_named
from .limits import DEFAULT_LIMITS, Limits, exhausted
from .messages import (
    Call,
    History,
    Reply,
    Result,
    User,
    failed_before,
    times_repeated,
    unanswered,
)
from .model import Model, Request
from .outcomes import Answered, Cancelled, Outcome, Paused, Stopped
from .policy import Decision, Policy

Show = Callable[[User | Reply | Result], None]
ANYTHING = Policy()


@dataclass
class Conversation:
    """The messages so far, there whatever happens to the loop that adds to them."""

    messages: History
    show: Show

    def add(self, message: Reply | Result) -> None:
        """Append, and show it for display and traces."""
        self.messages = (*self.messages, message)
        self.show(message)


async def run(
    model: Model,
    tools: tuple[Tool, ...],
    workspace: Workspace,
    messages: History,
    *,
    system: str = "",
    offered: tuple[Tool, ...] | None = None,
    limits: Limits = DEFAULT_LIMITS,
    policy: Policy = ANYTHING,
    approved: Call | None = None,
    show: Show = lambda message: None,
) -> Outcome:
    """Run a conversation until it is answered, paused, stopped or cancelled.

    Args:
        messages: the history so far; unanswered calls at its end are answered first.
        system: the prompt.
        offered: the tools the model is told of; None for all. It may know of others.
        limits: bounds; those of numbers and cost hold for the whole history.
        policy: which calls go ahead.
        approved: the one call a person has said yes to, exactly as it stands.
        show: is given every new message.
    """
    talk, clock = Conversation(messages, show), asyncio.timeout(limits.seconds)

    def permit(call: Call) -> Decision:
        return "allow" if call == approved else _decide(policy, tools, workspace, call)

    try:
        async with clock:
            ask = partial(_ask, model, system, tools if offered is None else offered)
            return await _converse(ask, tools, workspace, talk, limits, permit)
    except asyncio.CancelledError:
        return Cancelled(talk.messages)
    except TimeoutError:
        if not clock.expired():
            raise
        return Stopped(talk.messages, "limit", f"The limit of {limits.seconds:g} s was reached.")
    except BrokenToolError as error:
        return Stopped(talk.messages, "tool", str(error), error.__cause__)
    except ModelError as error:
        return Stopped(talk.messages, "model", str(error))
    except FleetError as error:
        return Stopped(talk.messages, "fleet", str(error))


async def _converse(
    ask: Callable[[History], Awaitable[Reply]],
    tools: tuple[Tool, ...],
    workspace: Workspace,
    talk: Conversation,
    limits: Limits,
    permit: Callable[[Call], Decision],
) -> Outcome:
    while True:
        for call in unanswered(talk.messages):
            before = failed_before(talk.messages)
            decision = "skip" if before and _moves(tools, call) else permit(call)
            if decision == "ask":
                return Paused(talk.messages, call)
            if decision == "skip":
                talk.add(failed(call, "skipped", f"Not done, because {before} before it failed."))
            elif decision == "refuse":
                talk.add(refused(call, f"{call.name} may not be called here; do without it."))
            else:
                talk.add(await answer(tools, workspace, call, limits.tool_seconds))
            if outcome := _ended(talk.messages):
                return outcome
        if reason := exhausted(talk.messages, limits):
            return Stopped(talk.messages, "limit", reason)
        reply = await ask(talk.messages)
        talk.add(reply)
        if not reply.calls:
            return Answered(talk.messages, reply.text)


def _ask(
    model: Model, system: str, offered: tuple[Tool, ...], messages: History
) -> Awaitable[Reply]:
    return model.reply(Request(system, messages, offered))


def _decide(policy: Policy, tools: tuple[Tool, ...], workspace: Workspace, call: Call) -> Decision:
    """What the policy says; a call that cannot be made does not trouble a person."""
    tool = tool_named(tools, call.name)
    decision = policy.decide(tool, workspace) if tool else "allow"
    if tool and decision == "ask":
        try:
            tool.parse(call.arguments)
        except ArgumentsError:
            return "allow"
    return decision


def _moves(tools: tuple[Tool, ...], call: Call) -> bool:
    tool = tool_named(tools, call.name)
    return tool is not None and tool.kind == "actuate"


def _ended(messages: History) -> Outcome | None:
    """How the last result ends the run, if it does: the model goes in circles, or is done."""
    result = messages[-1]
    assert isinstance(result, Result)
    most = 1 if result.error else 2
    if result.error != "skipped" and times_repeated(messages) >= most:
        what = "a failing call to" if result.error else "the same call to"
        reason = f"The model repeated {what} {result.name}: {result.text}"
        return Stopped(messages, "repeat", reason)
    return None if result.told is None else Answered(messages, result.told)
