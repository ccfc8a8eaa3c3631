"""The loop: answer the calls, check the limits, ask the model, append; nothing else."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from ..tools.errors import FleetError, ModelError, ToolError
from ..tools.tool import Tool
from ..tools.workspace import Workspace
from .messages import Call, History, Reply, Result, User, failed_before, unanswered
from .model import Model, Request
from .outcomes import Answered, Cancelled, Outcome, Paused, Stopped


@dataclass(frozen=True)
class Limits:
    """Bounds of one run."""

    requests: int = 20
    tool_calls: int = 60


DEFAULT_LIMITS = Limits()


def _nothing(message: User | Reply | Result) -> None:
    """Shows nobody anything."""


async def run(
    model: Model,
    tools: tuple[Tool, ...],
    workspace: Workspace,
    messages: History,
    *,
    system: str = "",
    limits: Limits = DEFAULT_LIMITS,
    allowed: Callable[[Call], bool] = lambda call: True,
    show: Callable[[User | Reply | Result], None] = _nothing,
) -> Outcome:
    """Run a conversation until it is answered, paused, stopped or cancelled.

    Args:
        messages: the history so far; unanswered calls at its end are answered first.
        system: the prompt.
        limits: bounds of the whole history.
        allowed: whether an actuating call may go ahead without a person.
        show: is given every new message, for display and traces.
    """
    history = messages
    try:
        while True:
            for call in unanswered(history):
                tool = _named(tools, call.name)
                if tool and _waits(tool, call, allowed):
                    return Paused(history, call)
                result = await _answer(tool, tools, workspace, call)
                history = (*history, result)
                show(result)
                if result.error and failed_before(history, call):
                    reason = f"The model repeated a failing call to {call.name}: {result.text}"
                    return Stopped(history, "repeat", reason)
                if tool and tool.kind == "end" and not result.error:
                    return Answered(history, result.text)
            if reason := _exhausted(history, limits):
                return Stopped(history, "limit", reason)
            reply = await model.reply(Request(system, history, tools))
            history = (*history, reply)
            show(reply)
            if not reply.calls:
                return Answered(history, reply.text)
    except asyncio.CancelledError:
        return Cancelled(history)
    except (ModelError, FleetError) as error:
        kind = "model" if isinstance(error, ModelError) else "fleet"
        return Stopped(history, kind, str(error))


async def _answer(
    tool: Tool | None, tools: tuple[Tool, ...], workspace: Workspace, call: Call
) -> Result:
    """Run one call; what the model got wrong comes back as a result it can act on."""
    if tool is None:
        known = ", ".join(t.name for t in tools)
        text = f"Unknown tool {call.name!r}. Available: {known}."
        return Result(call_id=call.id, name=call.name, text=text, error="unknown_tool")
    try:
        tool.parse(call.arguments)
    except ToolError as error:
        return Result(call_id=call.id, name=call.name, text=str(error), error="arguments")
    try:
        result = await tool.call(workspace, call.arguments)
    except ToolError as error:
        return Result(call_id=call.id, name=call.name, text=str(error), error="tool")
    return Result(call_id=call.id, name=call.name, text=result.text, images=result.images)


def _named(tools: tuple[Tool, ...], name: str) -> Tool | None:
    return next((tool for tool in tools if tool.name == name), None)


def _waits(tool: Tool, call: Call, allowed: Callable[[Call], bool]) -> bool:
    """Whether a person comes first. A malformed call does not trouble them."""
    try:
        tool.parse(call.arguments)
    except ToolError:
        return False
    return tool.kind == "ask" or (tool.kind == "actuate" and not allowed(call))


def _exhausted(history: History, limits: Limits) -> str | None:
    replies = [m for m in history if isinstance(m, Reply)]
    calls = sum(len(m.calls) for m in replies)
    if len(replies) >= limits.requests:
        return f"The limit of {limits.requests} requests was reached."
    if calls >= limits.tool_calls:
        return f"The limit of {limits.tool_calls} tool calls was reached."
    return None
