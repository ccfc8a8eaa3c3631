"""A tool is a typed function with a docstring; its JSON Schema is read from both, once.

The first parameter is the Context the call works with; the rest is what the model fills in.
Every parameter must be described, with unit and frame where it has one, or the import fails.
"""

import asyncio
import contextvars
import inspect
import json
import re
import threading
from collections.abc import Awaitable, Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from .context import Context
from .errors import ArgumentsError
from .schema import compact_schema, without_bounds
from .world import World

T = TypeVar("T")
Kind = Literal["read", "commit", "actuate", "ask", "end"]
"""read: finds things out; commit: makes a plan; actuate: moves robots; ask: a person answers;
end: gives up, which ends the turn."""


@dataclass(frozen=True)
class ToolResult:
    """What a tool returns.

    Attributes:
        data: JSON object; what the model reads.
        images: PNG or JPEG files, for models that see.
        world: what is known and decided from now on; None where nothing has changed.
        message: what the person is told, where this ends the turn.
    """

    data: dict[str, Any]
    images: tuple[bytes, ...] = field(default=(), repr=False)
    world: World | None = field(default=None, repr=False)
    message: str | None = None

    @property
    def text(self) -> str:
        """The data as compact JSON."""
        return json.dumps(self.data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


THREAD = "formup tool"
"""Name of the threads that tools run in."""
Answer = ToolResult | dict[str, Any]
ToolFunction = Callable[..., Answer | Awaitable[Answer]]


@dataclass(frozen=True)
class FilledBy:
    """Marks an argument that is of no use without another tool, named here."""

    tool: str


@dataclass(frozen=True)
class Tool:
    """A named function a model may call.

    Attributes:
        hidden: arguments that models are not offered.
    """

    name: str
    description: str
    kind: Kind
    arguments: type[BaseModel]
    function: ToolFunction
    hidden: frozenset[str] = frozenset()

    @property
    def schema(self) -> dict[str, Any]:
        """JSON Schema of the arguments (draft 2020-12)."""
        return compact_schema(self.arguments)

    @property
    def offered(self) -> dict[str, Any]:
        """The schema as models read it, in fewer words; `parse` reports what it leaves out."""
        schema = self.schema
        shown = {k: v for k, v in schema["properties"].items() if k not in self.hidden}
        return without_bounds(schema | {"properties": shown})

    def beside(self, names: Collection[str]) -> "Tool":
        """Return this tool as offered beside the named ones, without arguments that need others."""
        hidden = (
            name
            for name, field in self.arguments.model_fields.items()
            if any(isinstance(m, FilledBy) and m.tool not in names for m in field.metadata)
        )
        return replace(self, hidden=frozenset(hidden))

    def parse(self, arguments: Mapping[str, Any]) -> BaseModel:
        """Return validated arguments.

        Raises:
            ArgumentsError: they are against the schema; the text names every violation at once.
        """
        try:
            return self.arguments.model_validate(dict(arguments))
        except ValidationError as error:
            text = f"{self.name}: {violations(error)}"
            raise ArgumentsError(text, plain=violations(error, plain=True)) from None

    async def call(self, context: Context, arguments: Mapping[str, Any]) -> ToolResult:
        """Validate the arguments and run; a plain function runs in a thread of its own.

        A function that runs on after it was given up can no longer put a world in place.

        Raises:
            ArgumentsError: the arguments are against the schema.
            ToolError: what they ask for is not possible; for the model.
        """
        parsed = self.parse(arguments)
        values = {name: getattr(parsed, name) for name in type(parsed).model_fields}
        waiting = True

        def observed(world: World) -> None:
            if waiting:
                context.observed(world)

        given = replace(context, observed=observed)
        try:
            if inspect.iscoroutinefunction(self.function):
                answer = await self.function(given, **values)
            else:
                answer = await in_thread(lambda: self.function(given, **values))
        finally:
            waiting = False
        return answer if isinstance(answer, ToolResult) else ToolResult(dict(answer))


async def in_thread(work: Callable[[], Any]) -> Any:
    """Run without blocking the event loop, so that time limits and Ctrl-C work.

    The thread is a daemon of its own: a pool would wait for one that hangs as the program ends.
    """
    loop = asyncio.get_running_loop()
    done: asyncio.Future[Any] = loop.create_future()

    def settle(value: Any, error: BaseException | None) -> None:
        if done.cancelled():
            return
        if error is None:
            done.set_result(value)
        else:
            done.set_exception(error)

    def run() -> None:
        value, error = None, None
        try:
            value = work()
        except BaseException as raised:
            # No future takes a StopIteration, and a tool's sys.exit() must not end the program.
            plain = isinstance(raised, Exception) and not isinstance(raised, StopIteration)
            error = raised if plain else RuntimeError(repr(raised))
        with suppress(RuntimeError):  # the loop has been closed: nobody waits any more
            loop.call_soon_threadsafe(settle, value, error)

    context = contextvars.copy_context()
    threading.Thread(target=context.run, args=(run,), name=THREAD, daemon=True).start()
    return await done


async def to_its_end(work: Callable[[], T], *, last: bool = False) -> T:
    """Run work in a thread, such as a write, wait for it in any case and return its result.

    A cancellation takes effect afterwards, so that it is known here what was done.

    Args:
        last: whether nothing comes after it that could be cancelled.
    """
    job, task, cancelled = asyncio.ensure_future(in_thread(work)), asyncio.current_task(), False
    while not job.done():
        try:
            await asyncio.wait([job])
        except asyncio.CancelledError:
            cancelled = True
    if cancelled and not last and task is not None:
        task.uncancel()
        task.cancel()  # at whatever it waits for next
    return job.result()


def tool(kind: Kind) -> Callable[[ToolFunction], Tool]:
    """Make a Tool of a function: name, types and docstring become name, schema and description.

    The function takes the Context and what the model fills in, and returns a ToolResult or, where
    there are no pictures, its data alone. It may be async; if not it runs in a thread.

    Raises:
        TypeError: at import, when a parameter has no type or no line under `Args:`.
    """

    def wrap(function: ToolFunction) -> Tool:
        name = getattr(function, "__name__", "tool")
        description, documented = _docstring(inspect.getdoc(function) or "")
        hints = get_type_hints(function, include_extras=True)
        fields: dict[str, Any] = {}
        for parameter in list(inspect.signature(function).parameters.values())[1:]:
            if parameter.name not in documented or parameter.name not in hints:
                raise TypeError(
                    f"{name}: parameter {parameter.name!r} lacks a type or a line in Args"
                )
            default = ... if parameter.default is parameter.empty else parameter.default
            info = Field(default, description=documented[parameter.name])
            fields[parameter.name] = (hints[parameter.name], info)
        arguments = create_model(
            f"{name}_arguments", __config__=ConfigDict(extra="forbid", frozen=True), **fields
        )
        return Tool(name, description, kind, arguments, function)

    return wrap


def violations(error: ValidationError, *, plain: bool = False) -> str:
    """Return all violations of a validation as one line a model or a person can act on.

    Args:
        plain: name the argument without the path to it, and not at all where the text names it.
    """
    lines: list[str] = []
    items = error.errors(include_url=False)
    deeper = {item["loc"][:k] for item in items for k in range(len(item["loc"]))}
    for item in items:
        if item["loc"] in deeper:
            continue  # a consequence of what is wrong inside it
        names = [str(part) for part in item["loc"]]
        named = [name for name in names if not name.isdigit()]
        where = (named[-1] if plain and named else ".".join(names)) or "arguments"
        given = repr(item["input"])
        shown = given if len(given) <= 60 else given[:57] + "..."
        text = item["msg"].removeprefix("Value error, ")
        if item["type"] == "missing":
            lines.append(f"{where}: is missing")
        elif isinstance(item["input"], dict):  # the text names what of it is wrong
            lines.append(text if plain else f"{where}: {text}")
        else:
            lines.append(f"{where}: {text} (got {shown})")
    return "; ".join(dict.fromkeys(lines)) + "."


def _docstring(text: str) -> tuple[str, dict[str, str]]:
    """Return a docstring's description and its `Args:` lines by name."""
    head, _, tail = text.partition("\nArgs:\n")
    body = re.split(r"\n(?=\S)", tail)[0]
    documented = {
        match["name"]: " ".join(match["text"].split())
        for match in re.finditer(
            r"^ {4}(?P<name>\w+): (?P<text>.*(?:\n {5,}.*)*)", body, flags=re.MULTILINE
        )
    }
    return " ".join(head.split()), documented
