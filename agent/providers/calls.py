"""Calls as models and servers really write them: decorated names, arguments as text, calls in text.

What is ambiguous is not interpreted: it goes back to the model as it was written.
"""

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any, cast

from pydantic_core import from_json

from ...tools.tool import Tool
from ..messages import Call, Opaque, Reply
from ..model import Request
from .failures import empty
from .wire import dumped, safe_name

Written = tuple[str | None, str, object]
"""A call as it came: id, name, arguments."""
UNREADABLE = "this is not a JSON object"
"""The argument under which a model gets back arguments that could not be read. No tool has such a
parameter, so the call fails and says so, and what is sent on to servers is valid JSON."""
MOST_ID = 40
"""Most characters of an id; OpenAI refuses longer ones."""
_PLAIN_ID = re.compile(rf"[a-zA-Z0-9_-]{{1,{MOST_ID}}}")
_BEFORE_NAME = r"(?:.*(?:[.:/]|__)|(?:functions|default_api)_)?"
"""Namespaces: functions.NAME, default_api:NAME, mcp__SERVER__NAME, functions_NAME."""
_AFTER_NAME = r"(?:[:._#-]\d+|\(\)|<\|.*)?"
"""The number of a call in its reply, or special tokens: NAME:0, NAME<|channel|>commentary."""
_THOUGHTS = re.compile(r"\A.*</think(?:ing)?>", re.DOTALL)
"""Thoughts up to their closing tag; some servers swallow the opening one."""
_FENCED = re.compile(r"\A\s*```\w*\s(.*)```\s*\Z", re.DOTALL)
_CLOSED = re.compile(r"(?:\s*(?:</[\w-]+>|<\|[\w-]+\|>))+\s*\Z")
_OPENED = re.compile(r"^\s*(?=<tool_call>|<function_call>|\[TOOL_CALLS\])", re.MULTILINE)
_TAGS = re.compile(r"</?(?:tool_call|function_call)>|\[TOOL_CALLS\]")
_DECODER = json.JSONDecoder()


def read(text: str, written: list[Written], request: Request) -> tuple[str, tuple[Call, ...]]:
    """Return a reply's text without thoughts, and its calls, which may also stand in the text.

    Raises:
        AskError: there is neither text nor a call.
    """
    said = _THOUGHTS.sub("", text).strip()
    if not written and (found := calls_in_text(said, request.tools)):
        said, written = found
    if not said and not written:
        raise empty()
    return said, make_calls(written, request)


def make_calls(written: Iterable[Written], request: Request) -> tuple[Call, ...]:
    """Return calls of tools; missing and repeated ids are replaced, since each must be unique."""
    taken = {c.id for m in request.messages if isinstance(m, Reply) for c in m.calls}
    calls: list[Call] = []
    for given, name, arguments in written:
        id, number = given or "call", len(taken)
        while id in taken or id == "call":
            number += 1
            id = f"call_{number}"
        taken.add(id)
        tool = find_tool(name, request.tools)
        called = tool.name if tool else name
        calls.append(Call(id=id, name=called, arguments=arguments_of(arguments, tool)))
    return tuple(calls)


def find_tool(name: str, tools: tuple[Tool, ...]) -> Tool | None:
    """Return the tool that a name means, without what models put before and after it, or None."""
    exact = [tool for tool in tools if tool.name == name]
    bare = name.strip(" \n`'\"")
    return max(
        exact or [tool for tool in tools if _decorated(tool.name).fullmatch(bare)],
        key=lambda tool: len(tool.name),
        default=None,
    )


def arguments_of(given: object, tool: Tool | None = None) -> dict[str, Any]:
    """Return a call's arguments, whether they come as text or as an object.

    What is no JSON object goes under `UNREADABLE`: the tool refuses it, and the model reads why.
    """
    value: Any = given
    try:
        for _ in range(2):  # some servers encode the JSON twice
            value = _parsed(value) if isinstance(value, str) else value
    except (ValueError, RecursionError):
        return {UNREADABLE: given}
    if value is None:
        return {}
    if not isinstance(value, dict):
        return {UNREADABLE: value}
    schema = _schema(tool) if tool else {}
    return _shaped(cast("dict[str, Any]", value), schema, schema.get("$defs", {}))


def calls_in_text(text: str, tools: tuple[Tool, ...]) -> tuple[str, list[Written]] | None:
    """Return what a text says before the calls it ends with, and those calls; None without calls.

    Servers that do not know a model's format leave its calls in the text. Without the tags of such
    a format the whole text must be calls and nothing else; anything more may be meant as words.
    """
    tag = _OPENED.search(text)
    said, rest = (text[: tag.start()], text[tag.start() :]) if tag else ("", text)
    pieces = [piece for piece in _TAGS.split(rest) if piece.strip()] if tag else [rest]
    try:
        values = [value for piece in pieces for value in _values(piece)]
    except (ValueError, RecursionError):
        return None
    listed: list[Any] = []
    for value in values:
        listed += value if isinstance(value, list) else [value]
    calls = [_written_call(value, tools) for value in listed]
    known = [call for call in calls if call is not None]
    return (said.strip(), known) if known and len(known) == len(calls) else None


def give_names(
    written: Iterable[dict[str, Any]],
    calls: tuple[Call, ...],
    id: str,
    arguments: str = "",
    name: Callable[[str], str] = safe_name,
) -> None:
    """Set the ids and names that results will refer to in calls as they came.

    Args:
        id: the field of the id.
        arguments: the field of the arguments where they have to be an object; else they are text.
        name: makes a name that the API takes.
    """
    for item, call in zip(written, calls, strict=True):
        item |= {id: call.id, "name": name(call.name)}
        if arguments and not isinstance(item.get(arguments), dict):
            item[arguments] = call.arguments
        elif not (arguments or isinstance(item.get("arguments"), str)):
            item["arguments"] = dumped(call.arguments).decode()


class CallIds:
    """Ids of calls as they are sent: a model's own are sent back to it as they came.

    Args:
        owner: the model, and where it is asked.
    """

    def __init__(self, owner: str) -> None:
        self.owner = owner
        self._own: set[str] = set()

    def __call__(self, id: str) -> str:
        """Return an id to send; another model's id that servers may refuse becomes a plain one."""
        if id in self._own or _PLAIN_ID.fullmatch(id):
            return id
        digest = hashlib.sha256(id.encode(errors="replace")).hexdigest()[:12]
        return f"{safe_name(id)[: MOST_ID - 13]}_{digest}"

    def opaque(
        self, calls: tuple[Call, ...], items: tuple[dict[str, Any], ...] = ()
    ) -> Opaque | None:
        """Return what to store of a reply of the owner's; None where all of it can be rebuilt."""
        odd = any(not _PLAIN_ID.fullmatch(call.id) for call in calls)
        return Opaque(model=self.owner, items=items) if odd or items else None

    def items(self, reply: Reply) -> tuple[dict[str, Any], ...]:
        """Return what was stored of a reply if it was the owner's, whose ids are noted as such."""
        if reply.opaque is None or reply.opaque.model != self.owner:
            return ()
        self._own.update(call.id for call in reply.calls)
        return reply.opaque.items


@lru_cache(maxsize=64)
def _decorated(name: str) -> re.Pattern[str]:
    return re.compile(_BEFORE_NAME + re.escape(name) + _AFTER_NAME, re.DOTALL)


@lru_cache(maxsize=64)
def _schema(tool: Tool) -> dict[str, Any]:
    return tool.schema


def _parsed(text: str) -> Any:
    """Return the JSON value of a text, without fences, closing tags, `{}` and repeated values.

    Raises:
        ValueError: the text has no value, or several.
    """
    try:
        return from_json(text, allow_inf_nan=False) if text.strip() else {}
    except ValueError:
        values = _values(text)
    distinct = [v for n, v in enumerate(values) if v != {} and v not in values[:n]]
    if len(distinct) > 1 or not values:
        raise ValueError
    return distinct[0] if distinct else {}


def _values(text: str) -> list[Any]:
    """Return the JSON values that a text consists of."""
    fenced = _FENCED.match(text)
    body = _CLOSED.sub("", fenced[1] if fenced else text).strip()
    values: list[Any] = []
    at = 0
    while at < len(body):
        _, end = _DECODER.raw_decode(body, at)
        values.append(from_json(body[at:end], allow_inf_nan=False))
        at = len(body) - len(body[end:].lstrip())
    return values


def _written_call(value: Any, tools: tuple[Tool, ...]) -> Written | None:
    """Return the call that an object is, or None if it is or holds anything else."""
    fields = dict(cast("dict[str, Any]", value)) if isinstance(value, dict) else {}
    if fields.get("type") == "function":
        del fields["type"]
        fields = fields["function"] if isinstance(fields.get("function"), dict) else fields
    name, given = fields.get("name"), fields.get("arguments", fields.get("parameters"))
    known = isinstance(name, str) and find_tool(name, tools) is not None
    if len(fields) != 2 or not known or given is None or UNREADABLE in arguments_of(given):
        return None
    return None, str(name), given


def _shaped(value: Any, schema: Mapping[str, Any], kinds: Mapping[str, Any]) -> Any:
    """Fit a value to its schema: parse objects given as text, drop nulls for optional fields."""
    if not isinstance(value, str | list | dict):
        return value
    options = [schema, *schema.get("anyOf", ()), *schema.get("oneOf", ())]
    choices = [kinds.get(str(o.get("$ref", ""))[len("#/$defs/") :], o) for o in options]
    wanted = {choice.get("type") for choice in choices}
    if isinstance(value, str):
        if "string" in wanted or not wanted & {"object", "array"}:
            return value
        try:
            inner = _parsed(value)
        except (ValueError, RecursionError):
            return value
        return _shaped(inner, schema, kinds) if isinstance(inner, dict | list) else value
    if isinstance(value, list):
        items = [choice["items"] for choice in choices if "items" in choice]
        return [_shaped(v, (items or [{}])[0], kinds) for v in cast("list[Any]", value)]
    fields = {k: v for choice in choices for k, v in choice.get("properties", {}).items()}
    needed = {name for choice in choices for name in choice.get("required", ())}
    given = cast("dict[str, Any]", value).items()
    return {
        name: _shaped(each, fields.get(name, {}), kinds)
        for name, each in given
        if each is not None or not fields or name in needed
    }
