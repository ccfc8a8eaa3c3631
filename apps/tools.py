"""`formup tools`: lists the tools, prints schemas, and calls any one tool by hand."""

import asyncio
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from ..agent.store.folder import suffix_of
from ..tools.builtin import TOOLS
from ..tools.builtin.motions import ways_ahead
from ..tools.context import Context, Settings
from ..tools.draw import draw_look, draw_plan
from ..tools.errors import FleetError, InputError, ToolError
from ..tools.fleet.described import schema as fleet_schema
from ..tools.formation.contract import Contract
from ..tools.perception.image import load_picture
from ..tools.schema import compact_schema
from ..tools.store import StoredWorld, parse_json, picture_of, read_world, write_whole
from ..tools.world import World
from . import arguments as inputs
from . import options as o
from .terminal import say

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)


@app.command("list")
def list_tools(as_json: o.Json = False) -> None:
    """List the tools and what they do; with --json, their JSON Schemas."""
    if as_json:
        listed = [
            {"name": t.name, "description": t.description, "kind": t.kind, "parameters": t.schema}
            for t in TOOLS
        ]
        say(json.dumps(listed, indent=2))
        return
    for tool in TOOLS:
        say(f"{tool.name:20} {tool.kind:8} {tool.description.split('. ')[0].rstrip('.')}")


@app.command("schema")
def print_schema(
    name: Annotated[str, typer.Argument(help="contract, fleet, or the name of a tool.")],
) -> None:
    """Print the JSON Schema of a contract, a fleet file or a tool.

    Of a tool, it is the schema of its arguments. The draft is 2020-12.
    """
    schemas = {"contract": compact_schema(Contract), "fleet": fleet_schema()}
    schemas |= {t.name: t.schema for t in TOOLS}
    if name not in schemas:
        raise InputError(f"There is no schema {name!r}. There are: {', '.join(schemas)}.")
    say(json.dumps(schemas[name], indent=2))


@app.command("call")
def call_tool(
    name: Annotated[str, typer.Argument(help="Name of the tool.")],
    image: o.PictureFile = None,
    args: o.Arguments = "{}",
    state: o.StateFile = None,
    picture: o.DrawnFile = None,
    metres_per_pixel: o.MetresPerPixel = None,
) -> None:
    """Call one tool and print its answer as JSON.

    Pictures it returns are written beside the state file, or to the current folder.
    """
    tool = next((t for t in TOOLS if t.name == name), None)
    if tool is None:
        raise InputError(f"Unknown tool {name!r}. There are: {', '.join(t.name for t in TOOLS)}.")
    arguments = _arguments(args)
    context = _context(image, state, Settings(metres_per_pixel=inputs.scale(metres_per_pixel)))
    observed: list[World] = []
    try:
        called = tool.call(replace(context, observed=observed.append), arguments)
        result = asyncio.run(called)
    except (ToolError, FleetError, KeyboardInterrupt) as error:
        if metres_per_pixel is None and observed:  # a new scale is not stored after a refusal
            _save(observed[-1], context, state)  # such as a partial plan, or where robots stopped
        if isinstance(error, ToolError):
            raise InputError(str(error)) from None
        raise
    data = dict(result.data)
    folder = state.parent if state else Path()
    for number, shown in enumerate(result.images, start=1):
        written = folder / f"{name}-{number}.{suffix_of(shown)}"
        write_whole(written, shown)
        data.setdefault("pictures", []).append(str(written))
    world = result.world or context.world
    if picture is not None:
        data.setdefault("pictures", []).append(str(_draw(picture, context, world)))
    _save(world, context, state)
    say(json.dumps(data, indent=2, ensure_ascii=False))


def _draw(path: Path, context: Context, world: World) -> Path:
    """Draw the latest plan, or else what has been measured, on the picture; write it as PNG."""
    node, file = world.plans.get(next(reversed(world.plans), "")), io.BytesIO()
    drawn = draw_look(context.picture, world)
    if node is not None:
        ways = ways_ahead(context, world, node.plan)
        drawn = draw_plan(context.picture, world, node.plan, f"plan {node.plan.id}", ways=ways)
    drawn.save(file, "PNG")
    write_whole(path, file.getvalue())
    return path


def _save(world: World, context: Context, state: Path | None) -> None:
    if state is None:
        return
    lay = context.picture.path and str(context.picture.path)
    stored = StoredWorld(picture=lay, world=world)
    if state.exists():  # a plan.json stays one
        before = read_world(state)
        kept = {"plan_id": before.plan_id, "instruction": before.instruction}
        stored = stored.model_copy(update=kept)
    write_whole(state, stored.to_bytes())


def _arguments(text: str) -> dict[str, Any]:
    try:
        arguments = parse_json(text, "--args")
    except (ValueError, RecursionError) as error:
        raise InputError(f"--args is not JSON: {error}.") from None
    if not isinstance(arguments, dict):
        raise InputError(f'--args must be a JSON object such as {{"target": "t1"}}, not {text!r}.')
    return cast(dict[str, Any], arguments)


def _context(image: Path | None, state: Path | None, settings: Settings) -> Context:
    given = None if image is None else load_picture(image)
    if state is not None and state.exists():
        stored = read_world(state)
        return Context.of(picture_of(stored, state, given), settings, stored.world)
    if given is None:
        raise InputError("Give a picture with --image, or a state file that has one with --state.")
    return Context.of(given, settings)
