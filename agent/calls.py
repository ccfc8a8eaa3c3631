"""Answers one call: what the model got wrong comes back to it as a result it can act on.

A tool returns the next world, which the loop puts in place, so one that hangs, breaks or is
interrupted has changed nothing but what it had observed by then.
"""

import asyncio
import os
import traceback
from contextlib import AbstractAsyncContextManager, nullcontext
from weakref import WeakKeyDictionary

from ..tools.context import Context
from ..tools.errors import ArgumentsError, FormupError, ToolError
from ..tools.tool import Tool
from ..tools.world import World
from .messages import Call, ErrorKind, Result

SLOTS = max(8, 2 * (os.cpu_count() or 1))
"""Most tools that work at a time: more are no faster, but take memory and each other's time."""
_slots: WeakKeyDictionary[asyncio.AbstractEventLoop, asyncio.Semaphore] = WeakKeyDictionary()


class BrokenToolError(Exception):
    """A tool raised an exception that no tool should raise, which is the cause of this one."""


def tool_named(tools: tuple[Tool, ...], name: str) -> Tool | None:
    """Return the tool of a name, or None."""
    return next((tool for tool in tools if tool.name == name), None)


async def answer(
    tools: tuple[Tool, ...],
    context: Context,
    call: Call,
    seconds: float | None,
) -> Result:
    """Run one call and return its result.

    Args:
        context: its `observed` is given the next world.
        seconds: how long the tool may take; None is no limit. Tools that drive robots are exempt.

    Raises:
        BrokenToolError: the tool has a bug.
        FleetError: robots failed, or what they do is not known.
        InputError: something the person fixed cannot be used.
    """
    tool = tool_named(tools, call.name)
    if tool is None:
        return failed(call, "unknown_tool", _unknown(call, tools))
    clock = asyncio.timeout(None)
    try:
        async with _slot(tool), clock:
            _start(clock, None if tool.kind == "actuate" else seconds)
            result = await tool.call(context, call.arguments)
            text = result.text
    except ArgumentsError as error:
        return failed(call, "arguments", str(error), error)
    except ToolError as error:
        return failed(call, "tool", str(error), error)
    except FormupError:
        raise
    except Exception as error:
        if isinstance(error, TimeoutError) and clock.expired():
            text = f"{tool.name} did not end within {seconds:g} s and was given up."
            return failed(call, "timeout", text)
        raise BrokenToolError(_where(tool, error)) from error
    made = None
    if result.world is not None:
        made = _plan_made(context.world, result.world)
        context.observed(result.world)
    return Result(
        call_id=call.id,
        name=call.name,
        text=text,
        facts={"plan_id": made} if made else None,
        images=result.images,
        message=result.message,
    )


def _unknown(call: Call, tools: tuple[Tool, ...]) -> str:
    known = ", ".join(tool.name for tool in tools)
    return f"Unknown tool {call.name!r}. Available: {known}."


def _start(clock: asyncio.Timeout, seconds: float | None) -> None:
    """Let a clock run for so many seconds from now on, unless that is None."""
    if seconds is not None:
        clock.reschedule(asyncio.get_running_loop().time() + seconds)


def _slot(tool: Tool) -> AbstractAsyncContextManager[None]:
    """Return what waits for a place among working tools; driving and asking need none."""
    if tool.kind in ("actuate", "ask"):
        return nullcontext()
    return _slots.setdefault(asyncio.get_running_loop(), asyncio.Semaphore(SLOTS))


def _plan_made(before: World, after: World) -> str | None:
    """Return the id of the plan that a call has made, or None."""
    name = next(reversed(after.plans), "")
    return name if after.plans.get(name) is not before.plans.get(name) else None


def failed(call: Call, kind: ErrorKind, text: str, error: ToolError | None = None) -> Result:
    """Return the result of a call that failed."""
    result = Result(call_id=call.id, name=call.name, text=text, error=kind)
    if error is None:
        return result
    causes = {"images": error.images, "cause": error.kind, "facts": error.facts or None}
    return result.model_copy(update=causes)


def refused(call: Call, why: str) -> Result:
    """Return the result of a call that may not be made."""
    return failed(call, "refused", why)


def _where(tool: Tool, error: Exception) -> str:
    """Return one sentence for whoever wrote the tool: what it raised, and where."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    raised = " ".join(f"{type(error).__name__}: {error}".split())
    return f"The tool {tool.name} broke ({raised}) at line {last.lineno} of {last.filename}."
