"""`formup trace FILE`: prints what happened in a run, for a person to read."""

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..agent.session import model_name, prompt_name
from ..agent.session_start import read_session
from ..agent.store.folder import PICTURES, FolderArtefacts, log_path
from ..agent.store.protocol import Event
from ..tools.errors import InputError
from . import options as o
from .run_display import STATUS_STYLE
from .terminal import styled, under

LONGEST = 300
"""Most characters shown of one text; the trace has all of it."""
COLUMN = 8
"""The column where texts begin."""


def show_trace(file: o.TraceFile) -> None:
    """Show a run step by step.

    Prints messages, tool calls, times, tokens, cost and the files of pictures.
    """
    root = log_path(file).parent
    pictures = FolderArtefacts(root / PICTURES)

    def where(sha256: str) -> str:
        return str(root / (pictures.name(sha256) or "missing"))

    show_events(read_session(file), where, str(file), f"continue with formup resume {file}")


def show_events(
    events: Sequence[Event], where: Callable[[str], str], name: str, how_on: str
) -> None:
    """Print the events of a session.

    Args:
        where: returns the place of a picture, given its hash.
        name: what an error calls the session.
        how_on: says how to go on with the session if it broke off.

    Raises:
        InputError: the events are damaged.
    """
    try:
        _show(where, how_on, *events)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        raise InputError(
            f"{name} is damaged; it is not a complete session written by formup."
        ) from None


def _show(where: Callable[[str], str], how_on: str, start: Event, *events: Event) -> None:
    console = Console(highlight=False)
    prompt = prompt_name(start.data["prompt"])
    with_prompt = f", prompt {prompt}" if prompt else ""
    picture = start.data["picture"]
    size = f"{picture['facts']['width']} x {picture['facts']['height']} px"
    lay = picture["path"] or "a picture"
    console.print(styled(f"{model_name(start.data)}{with_prompt}, on {lay}, {size}"))
    turns = [i for i, event in enumerate(events) if event.kind == "turn"]
    for first, after in zip(turns, [*turns[1:], len(events)], strict=True):
        console.print(styled(events[first].data["words"], style="bold"))
        console.print(_steps(events[first:after], where))
        last = [e for e in events[first:after] if e.kind in ("end", "resume")][-1:]
        console.print(_end(last[0] if last else events[after - 1], how_on))


def _steps(events: Sequence[Event], where: Callable[[str], str]) -> Table:
    """Return a table of messages, each with the time since the one before, and any cost."""
    counts = any(any(_spent(event.data)) for event in events)
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="cyan")
    for title in ("at", "took", "tokens", "USD") if counts else ("at", "took"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("step", overflow="fold")
    before = 0.0
    for event in events:
        now = event.seconds
        if event.kind == "resume":
            table.add_row(*[""] * (len(table.columns) - 1), styled("resumed", style="yellow"))
            before = 0.0
        if event.kind == "message":
            spent = _spent(event.data) if counts else ()
            shown = styled("\n").join(_step(event.data, where))
            table.add_row(f"{now:.2f} s", f"{now - before:.2f} s", *spent, shown)
            before = now
    return table


def _spent(message: Mapping[str, Any]) -> tuple[str, str]:
    usage: dict[str, Any] = message.get("usage") or {}
    used = usage.get("input_tokens", 0), usage.get("output_tokens", 0)
    cost = usage.get("cost_usd", 0.0)
    return f"{used[0]:,}+{used[1]:,}" if any(used) else "", f"{cost:.4f}" if cost else ""


def _step(message: Mapping[str, Any], where: Callable[[str], str]) -> list[Text]:
    """Return a message as lines: its author and text, its calls, its pictures."""
    lines: list[Text] = []
    text = _short(message.get("text", ""))
    if message["role"] == "user":
        lines.append(styled(("person  ", "bold"), text))
    elif message["role"] == "assistant":
        if text:
            lines.append(styled(("model   ", "bold"), text))
        for call in message.get("calls", ()):
            arguments = json.dumps(call["arguments"], ensure_ascii=False)
            named = (f"{call['name']} ", "cyan")
            lines.append(styled(("call    ", "bold"), named, _short(arguments)))
    else:
        error = (f"{message['error']}: ", "red") if message.get("error") else ""
        named = (f"{message['name']} ", "cyan")
        lines.append(styled(("result  ", "bold"), named, error, text))
    files = [where(image["sha256"]) for image in message["images"]]
    return lines + [styled(("picture ", "bold"), file) for file in files]


def _end(last: Event, how_on: str) -> Text:
    if last.kind != "end":
        return styled(("killed: ", "bold red"), f"broken off; {how_on}")
    end = last.data
    usage, style = end["usage"], STATUS_STYLE.get(end["status"], "bold")
    counts = (
        f"{usage['requests']} requests, {usage['tool_calls']} tool calls, "
        f"{usage['input_tokens']:,}+{usage['output_tokens']:,} tokens, "
        f"{usage['cost_usd']:.4f} USD, {usage['seconds']:.2f} s"
    )
    return styled((f"{end['status']}: ", style), _short(end["message"]), "\n", counts)


def _short(text: str) -> str:
    return under(text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ...", COLUMN)
