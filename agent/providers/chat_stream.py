"""Puts the fragments of a chat completion together, however servers cut them."""

import io
import re
from typing import Any, cast

from pydantic_core import from_json

from .wire import Assembly, dumped

_GOES_BACK = re.compile(r"reasoning|thinking|thought|extra_content|provider_specific_fields")
_GROWING = {"text", "summary", "thinking", "data"}
"""Fields of list items whose fragments are joined; for other fields the last value counts."""


def goes_back(name: str) -> bool:
    """Return whether a message field may have to be sent back: thoughts and their signatures."""
    return _GOES_BACK.match(name) is not None


def joined_text(content: str | list[dict[str, Any]]) -> str:
    """Return content as text; some servers answer in parts, the form requests may have."""
    if isinstance(content, str):
        return content
    return "".join([str(part.get("text") or "") for part in content])


class ChatAssembly(Assembly):
    """Assembles the chunks of a chat completion."""

    events = "chat completions"

    def __init__(self) -> None:
        self._choices: dict[int, _Choice] = {}
        self._usage: Any = None

    def take(self, event: dict[str, Any]) -> str:
        """Add a chunk and return the text it brings to the first choice."""
        self._usage = event.get("usage") or self._usage
        shown = ""
        for fragment in event.get("choices") or ():
            index = int(fragment.get("index") or 0)
            choice = self._choices.setdefault(index, _Choice())
            text = choice.take(fragment)
            shown += "" if index else text
            self.done = self.done or bool(fragment.get("finish_reason"))
        return shown

    def whole(self) -> Any:
        """Return the complete body."""
        choices = [choice.whole() for _, choice in sorted(self._choices.items())]
        return {"choices": choices, "usage": self._usage}


class _Choice:
    """One of the choices in a stream; nearly always there is only one."""

    def __init__(self) -> None:
        self._text, self._refusal = io.StringIO(), io.StringIO()
        self._parts: list[Any] = []
        self._calls: list[dict[str, Any]] = []
        self._more: dict[str, Any] = {}
        self._finish: Any = None

    def take(self, fragment: dict[str, Any]) -> str:
        """Add a fragment and return the text it brings."""
        self._finish = fragment.get("finish_reason") or self._finish
        # Some servers put all of the message into one event.
        delta: dict[str, Any] = fragment.get("delta") or fragment.get("message") or {}
        for part in delta.get("tool_calls") or ():
            self._call(part)
        for name, value in delta.items():
            if value is not None and goes_back(name):
                self._more[name] = _continued(self._more.get(name), value)
        if delta.get("refusal"):
            self._refusal.write(joined_text(delta["refusal"]))
        content = delta.get("content") or ""
        text = joined_text(content)
        self._text.write(text)
        if self._parts or not isinstance(content, str):
            parts = [{"type": "text", "text": text}] if isinstance(content, str) else content
            self._parts = _continued(self._parts, parts)
        return text

    def whole(self) -> dict[str, Any]:
        """Return the choice as it would have come unstreamed."""
        functions = [c["function"] | {"arguments": "".join(c["arguments"])} for c in self._calls]
        calls = [
            call["more"] | {"id": call["id"], "function": function}
            for call, function in zip(self._calls, functions, strict=True)
        ]
        content = self._parts or self._text.getvalue()
        message = {"content": content, "refusal": self._refusal.getvalue(), "tool_calls": calls}
        return {"message": self._more | message, "finish_reason": self._finish}

    def _call(self, part: dict[str, Any]) -> None:
        """Add the fragment of a call."""
        function: dict[str, Any] = part.get("function") or {}
        id, name, given = part.get("id"), function.get("name"), function.get("arguments")
        call = self._continuing(part.get("index"), id, name)
        if call is None:
            call = dict[str, Any](index=part.get("index"), id=None, arguments=[])
            call |= {"more": {}, "function": {"name": ""}}
            self._calls.append(call)
        call["id"] = call["id"] or id
        if name:  # sent in parts, or whole with every fragment
            before = call["function"]["name"]
            call["function"]["name"] = name if name.startswith(before) else before + name
        if given is not None:
            call["arguments"].append(given if isinstance(given, str) else dumped(given).decode())
        known = {"index", "id", "type", "function", "name", "arguments"}
        for more, fields in ((call["more"], part), (call["function"], function)):
            more.update({k: v for k, v in fields.items() if v is not None and k not in known})

    def _continuing(self, index: Any, id: Any, name: Any) -> dict[str, Any] | None:
        """Return the call that a fragment continues; None where it begins a new one.

        Some servers leave out the index or give every parallel call the same one, and some send
        no ids or a different one with each fragment.
        """
        alike = [call for call in self._calls if call["index"] == index]
        if not alike and index is None and not (id or name):
            alike = self._calls
        same = [call for call in alike if id and call["id"] == id]
        if same or not alike:
            return same[-1] if same else None
        call, written = alike[-1], "".join(alike[-1]["arguments"])
        begins = name and written and (name != call["function"]["name"] or _is_complete(written))
        if id and call["id"]:
            begins = name or _is_complete(written)
        return None if begins else call


def _is_complete(written: str) -> bool:
    """Return whether arguments are complete; an empty object may merely precede them."""
    try:
        return bool(from_json(written))
    except ValueError:
        return False


def _continued(before: Any, value: Any) -> Any:
    """Return a field with its next fragment added.

    A fragment of a list continues the items of the same index, or without one the last item.
    """
    if isinstance(before, str) and isinstance(value, str):
        return before + value
    if not (isinstance(before, list) and isinstance(value, list)):
        return value
    items, fragments = cast("list[Any]", before), cast("list[Any]", value)
    for item in fragments:
        kind = item.get("type"), item.get("index")
        known = [held for held in items if (held.get("type"), held.get("index")) == kind]
        if item.get("index") is None:
            last = known[-1:] if known and known[-1] is items[-1] else []
            known = [held for held in last if not (held.get("signature") or held.get("data"))]
        if not known:
            items.append(item)
            continue
        for name, more in item.items():
            if more is not None:
                grows = name in _GROWING and known[-1].get(name)
                known[-1][name] = _continued(known[-1][name], more) if grows else more
    return items
