"""Pages of the reference for commands, tools, HTTP and fleet files, as Markdown."""

import json
import re
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from typing import Any

import typer
from fastapi import FastAPI
from fields import code, described, fields, prose, table, type_of, types
from formup.apps.cli import app as command_line
from formup.apps.server.app import PARTS
from formup.tools.builtin import TOOLS
from formup.tools.fleet.described import schema as fleet_schema
from formup.tools.formation.contract import Contract
from formup.tools.schema import compact_schema

CONTRACT = {"$ref": "#/contract"}
ALONE = "formup"
"""The page of commands that belong to no group."""


def commands() -> dict[str, str]:
    """A page for each group of commands, and one that leads to them."""
    whole: Any = typer.main.get_command(command_line)
    groups = {name: found for name, found in whole.commands.items() if hasattr(found, "commands")}
    alone = {name: found for name, found in whole.commands.items() if name not in groups}
    pages = {ALONE: ("formup", whole.help, alone)}
    pages |= {name: (f"formup {name}", g.help, g.commands) for name, g in groups.items()}
    made = {
        f"commands/{page}.md": f"# {title}\n\n{prose(about)}\n\n"
        + "\n".join(command(f"{title} {name}", found) for name, found in inside.items())
        for page, (title, about, inside) in pages.items()
    }
    made["commands.md"] = (
        "# Every command\n\nAs `--help` shows them; [the command line](../command-line.md) tells "
        "how they work together.\n\n```{toctree}\n:maxdepth: 2\n\n"
        + "\n".join(f"commands/{page}" for page in pages)
        + "\n```\n"
    )
    return made


def command(name: str, found: Any) -> str:
    """A command with its arguments and options, in the words of its `--help`."""
    context = typer.Context(found, info_name=name)
    usage = found.get_usage(context).removeprefix("Usage: ")
    records = [found.get_help_record(context) for found in found.params]
    rows = [[code(left), with_options(right)] for left, right in filter(None, records)]
    about = "\n\n".join(with_options(part) for part in (found.help or "").split("\n\n"))
    shown = table(("argument or option", "meaning"), rows)
    return f"## {name}\n\n{about}\n\n```text\n{usage}\n```\n\n{shown}"


def with_options(text: str) -> str:
    """Text in which the names of options are code."""
    return prose(re.sub(r"(?<!\S)--[a-z][a-z-]*", r"`\g<0>`", text))


def schemas() -> dict[str, str]:
    """The files that pages offer to be kept, as `formup tools schema` prints them."""
    found = {"contract": compact_schema(Contract), "fleet": fleet_schema(), "openapi": openapi()}
    found |= {tool.name: tool.schema for tool in TOOLS}
    return {f"schemas/{name}.json": json.dumps(s, indent=2) + "\n" for name, s in found.items()}


def schema_file(name: str) -> str:
    """A link to one of those files."""
    return f"[JSON Schema](schemas/{name}.json)"


def tools() -> str:
    """The tools with their arguments, and the contract that some of them take."""
    parts = [
        "# Tools that models see\n",
        "What a model is offered, over MCP too. A tool's kind says what it may do: `read` finds "
        "things out, `commit` makes a plan, `actuate` moves robots, `ask` and `end` end the turn. "
        "`formup tools schema NAME` prints the schema of its arguments, `formup tools call` calls "
        "it.\n",
    ]
    for tool in TOOLS:
        known = dict(tool.schema["properties"])
        if "contract" in known:  # which has a section of its own
            known["contract"] = {**CONTRACT, "description": known["contract"]["description"]}
        shown = {**tool.schema, "properties": known}
        parts += [f"## {tool.name}\n", prose(tool.description) + "\n"]
        parts.append(f"Kind: {code(tool.kind)}. Arguments: {schema_file(tool.name)}.\n")
        parts += [fields(shown, "tools"), *types(tool.schema.get("$defs", {}), "tools", "###")]
    parts += list(types({"contract": compact_schema(Contract)}, "tools"))
    return "\n".join([*parts, schema_file("contract"), ""])


def fleet() -> str:
    """The keys of a file that describes a fleet, by its kind."""
    schema = fleet_schema()
    parts = [
        "# Fleet files\n",
        "Keys of the YAML file that `--fleet` names, by its `fleet`: "
        "[simulated](../command-line.md), [MQTT](../fleets.md), [ROS 2](../ros.md), "
        "[VDA 5050](../warehouse.md) or poses that were recorded. `formup tools schema fleet` "
        f"prints the {schema_file('fleet')}.\n",
    ]
    for kind in schema["oneOf"]:
        name = kind["properties"]["fleet"]["const"]
        parts += [f"## fleet: {name}\n", described(kind)[0] + "\n", fields(kind, "fleet")]
    parts += ["## Types\n", *types(schema["$defs"], "fleet", "###")]
    return "\n".join(parts)


def openapi() -> dict[str, Any]:
    """The OpenAPI document of `formup serve`."""
    api = FastAPI(title="formup", version=version("formup"))
    for part in PARTS:
        api.include_router(part.router)
    return api.openapi()


def http() -> str:
    """The routes of a server, with what they take and answer."""
    document = openapi()
    found = [(m, p, o) for p, ms in document["paths"].items() for m, o in ms.items()]
    rows = [
        [f"[`{m.upper()}`](#http-{o['operationId']})", code(p), prose(o.get("description", ""))]
        for m, p, o in found
    ]
    parts = [
        "# HTTP\n",
        "What `formup serve` answers; [a server](../serving.md) tells how it is used. The whole is "
        "an [OpenAPI document](schemas/openapi.json), at `/openapi.json` of a running server.\n",
        "## Routes\n",
        table(("method", "path", "does"), rows),
    ]
    for method, path, operation in found:
        parts += [f"(http-{operation['operationId']})=\n### {method.upper()} {path}\n"]
        parts += [prose(operation.get("description", "")) + "\n", *exchange(operation)]
    parts += ["## Types\n", *types(document["components"]["schemas"], "http", "###")]
    return "\n".join(parts)


def exchange(operation: Mapping[str, Any]) -> Iterator[str]:
    """What a route takes and answers."""
    rows = [
        [
            code(taken["name"]),
            taken["in"],
            type_of(taken["schema"], "http"),
            "required" if taken.get("required") else "",
        ]
        for taken in operation.get("parameters", ())
    ]
    yield table(("parameter", "in", "type", ""), rows)
    if body := operation.get("requestBody"):
        yield f"Body: {contents(body)}.\n"
    answers = operation["responses"].items()
    good = [f"{status}: {contents(answer)}" for status, answer in answers if status < "400"]
    bad = [status for status, _ in answers if status >= "400"]
    yield f"Answers {'; '.join(good)}{'. Errors: ' if bad else ''}{', '.join(bad)}.\n"


def contents(message: Mapping[str, Any]) -> str:
    """Media types of a body, with what JSON holds."""
    found = message.get("content", {}).items()
    kinds = (
        type_of(media["schema"], "http") if "$ref" in media.get("schema", {}) else code(name)
        for name, media in found
    )
    return " or ".join(kinds) or "nothing"
