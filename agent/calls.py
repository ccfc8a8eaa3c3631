"""One call answered: what the model got wrong comes back to it as a result it can act on.

A tool works on a copy of the workspace that is kept when it returns or says what it cannot do, so
that one which hangs, breaks or is interrupted has changed nothing.
"""

import asyncio
import traceback

from ..tools.errors import ArgumentsError, FleetError, FormupError, ToolError
from ..tools.tool import Tool
from ..tools.world import Workspace
from .messages import Call, ErrorKind, Result


class BrokenToolError(Exception):
    """A tool raised what no tool should; its cause is that exception."""


def tool_named(tools: tuple[Tool, ...], name: str) -> Tool | None:
    """The tool a call means."""
    return next((tool for tool in tools if tool.name == name), None)


async def answer(
    tools: tuple[Tool, ...], workspace: Workspace, call: Call, seconds: float | None
) -> Result:
    """Run one call.

    Args:
        seconds: how long the tool may take; None is as long as it likes.

    Raises:
        BrokenToolError: the tool has a mistake in it.
        FleetError: robots failed, or what they do is not known.
        InputError: something the person fixed cannot be used.
    """
    tool = tool_named(tools, call.name)
    if tool is None:
        known = ", ".join(t.name for t in tools)
        return failed(call, "unknown_tool", f"Unknown tool {call.name!r}. Available: {known}.")
    trial, clock = workspace.copy(), asyncio.timeout(seconds)
    try:
        async with clock:
            result = await tool.call(trial, call.arguments)
            text = result.text
    except ArgumentsError as error:
        return failed(call, "arguments", str(error), error)
    except ToolError as error:
        workspace.adopt(trial)
        return failed(call, "tool", str(error), error)
    except FormupError:
        raise
    except Exception as error:
        if isinstance(error, TimeoutError) and clock.expired():
            return _late(tool, call, seconds)
        raise BrokenToolError(_where(tool, error)) from error
    workspace.adopt(trial)
    return Result(
        call_id=call.id, name=call.name, text=text, images=result.images, told=result.told
    )


def failed(call: Call, kind: ErrorKind, text: str, error: ToolError | None = None) -> Result:
    """The answer to a call that came to nothing."""
    result = Result(call_id=call.id, name=call.name, text=text, error=kind)
    if error is None:
        return result
    causes = {"images": error.images, "cause": error.kind, "facts": error.facts or None}
    return result.model_copy(update=causes)


def refused(call: Call, why: str) -> Result:
    """The answer to a call that may not be made."""
    return failed(call, "refused", why)


def _late(tool: Tool, call: Call, seconds: float | None) -> Result:
    if tool.kind == "actuate":
        raise FleetError(
            f"{tool.name} did not end within {seconds:g} s; where the robots are is not known."
        )
    text = f"{tool.name} did not end within {seconds:g} s and was given up; nothing was changed."
    return failed(call, "timeout", text)


def _where(tool: Tool, error: Exception) -> str:
    """One sentence for whoever wrote the tool."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    said = " ".join(f"{type(error).__name__}: {error}".split())
    return f"The tool {tool.name} broke ({said}) at line {last.lineno} of {last.filename}."
