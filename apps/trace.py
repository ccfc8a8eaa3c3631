"""`formup trace FILE`: a run as it went, for reading."""

import json
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..agent.store.folder import Trace, prompt_name, read_trace
from . import options as o
from .run_display import STATUS_STYLE

LONGEST = 300
"""Characters shown of one text; the trace has all of it."""


def show_trace(file: o.TraceFile) -> None:
    """Show a run step by step: what was said and called, times, tokens, cost, pictures."""
    trace, console = read_trace(file), Console(highlight=False)
    start = trace.start
    console.print(Text(start["instruction"], style="bold"))
    prompt = prompt_name(start["prompt"])
    with_prompt = f", prompt {prompt}" if prompt else ""
    image = trace.state()[0].image
    size = f"{image.width} x {image.height} px"
    console.print(Text(f"{start['model']}{with_prompt}, on {image.path or 'a picture'}, {size}"))
    console.print(_steps(trace))
    console.print(_end(trace))


def _steps(trace: Trace) -> Table:
    """A row for each message, with the time since the one before and what it cost, if anything."""
    counts = any(any(_spent(line)) for line in trace.lines)
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="cyan")
    for title in ("at", "took", "tokens", "USD") if counts else ("at", "took"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("step", overflow="fold")
    before = 0.0
    for line in trace.lines:
        now = float(line["seconds"])
        if line["type"] == "resume":
            table.add_row(*[""] * (len(table.columns) - 1), Text("resumed", style="yellow"))
            before = 0.0
        if line["type"] == "message":
            spent = _spent(line) if counts else ()
            shown = Text("\n").join(_step(trace, line))
            table.add_row(f"{now:.2f} s", f"{now - before:.2f} s", *spent, shown)
            before = now
    return table


def _spent(line: dict[str, Any]) -> tuple[str, str]:
    usage: dict[str, Any] = line.get("usage") or {}
    used = usage.get("input_tokens", 0), usage.get("output_tokens", 0)
    cost = usage.get("cost_usd", 0.0)
    return f"{used[0]:,}+{used[1]:,}" if any(used) else "", f"{cost:.4f}" if cost else ""


def _step(trace: Trace, line: dict[str, Any]) -> list[Text]:
    """A message as lines: who, what it says, calls, pictures."""
    said: list[Text] = []
    if line["role"] == "user":
        said.append(Text.assemble(("person  ", "bold"), _short(line["text"])))
    elif line["role"] == "assistant":
        if line["text"]:
            said.append(Text.assemble(("model   ", "bold"), _short(line["text"])))
        for call in line["calls"]:
            arguments = json.dumps(call["arguments"], ensure_ascii=False)
            named = (f"{call['name']} ", "cyan")
            said.append(Text.assemble(("call    ", "bold"), named, _short(arguments)))
    else:
        error = (f"{line['error']}: ", "red") if line["error"] else ""
        named = (f"{line['name']} ", "cyan")
        said.append(Text.assemble(("result  ", "bold"), named, error, _short(line["text"])))
    said += [
        Text.assemble(("picture ", "bold"), str(trace.path.parent / image["path"]))
        for image in line["images"]
    ]
    return said


def _end(trace: Trace) -> Text:
    end = trace.end
    if end is None:
        text = f"broken off; formup resume {trace.path} goes on"
        return Text.assemble(("killed: ", "bold red"), text)
    usage, style = end["usage"], STATUS_STYLE.get(end["status"], "bold")
    counts = (
        f"{usage['requests']} requests, {usage['tool_calls']} tool calls, "
        f"{usage['input_tokens']:,}+{usage['output_tokens']:,} tokens, "
        f"{usage['cost_usd']:.4f} USD, {usage['seconds']:.2f} s"
    )
    return Text.assemble((f"{end['status']}: ", style), _short(end["message"]), "\n", counts)


def _short(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."
