"""A person's own calls, such as undo, in a model's place."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from ..messages import Call, Reply, Result, turn_of
from ..model import Request
from ..offline.answering import arrived, said_of_edit, said_of_undo
from ..offline.followup import Followup


class Commands:
    """A model that makes the calls it is given, in one reply, then says what came of them.

    Args:
        calls: names of tools and their arguments.
        text: what it says if there are no calls.
    """

    name = "person"

    def __init__(self, calls: Sequence[tuple[str, dict[str, Any]]], text: str = "") -> None:
        self._calls, self._text = calls, text

    async def reply(self, request: Request) -> Reply:
        """Return the calls, or once they are made the sentence that ends the turn."""
        turn = turn_of(request.messages)
        results = [m for m in turn if isinstance(m, Result)]
        if results and not self._calls:
            asked = {c.id: c.arguments for m in turn if isinstance(m, Reply) for c in m.calls}
            return Reply(text=" ".join(_result_text(m, asked[m.call_id]) for m in results))
        number = sum(isinstance(m, Reply) for m in request.messages) + 1
        calls = (
            Call(id=f"command-{number}-{k}", name=name, arguments=arguments)
            for k, (name, arguments) in enumerate(self._calls)
        )
        reply, self._calls = Reply(text=self._text, calls=tuple(calls)), ()
        return reply


def _result_text(result: Result, arguments: Mapping[str, Any]) -> str:
    """Return what the person reads about one call's result."""
    if result.error:
        return str((result.facts or {}).get("plain", result.text))
    data = json.loads(result.text)
    scale = data.get("metres_per_pixel")
    if result.name == "deploy":
        return arrived(data, scale)
    if result.name == "undo":
        steps, to = arguments.get("steps", 1), arguments.get("to") or ""
        return said_of_undo(Followup(kind="undo", undo=steps, to=to), data, scale)
    return said_of_edit(data, scale)
