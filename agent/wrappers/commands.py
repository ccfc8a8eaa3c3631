"""A person's command in a model's place: calls they gave themselves, such as undo, and no words."""

from collections.abc import Sequence

from ..messages import Call, Reply, Result, turn_of
from ..model import Request
from ..offline.answering import said_of_call

NAME = "person"


class Commands:
    """Makes the calls it is given, in one reply, then says what came of them.

    Args:
        calls: names of tools and their arguments.
        text: what is said where there are no calls.
    """

    name = NAME

    def __init__(self, calls: Sequence[tuple[str, dict[str, object]]], text: str = "") -> None:
        self._calls, self._text = calls, text

    async def reply(self, request: Request) -> Reply:
        """The calls, or the sentence that ends the turn."""
        turn = turn_of(request.messages)
        results = [m for m in turn if isinstance(m, Result)]
        if results:
            return Reply(text=" ".join(said_of_call(m) for m in results))
        number = sum(isinstance(m, Reply) for m in request.messages) + 1
        calls = (
            Call(id=f"command-{number}-{k}", name=name, arguments=arguments)
            for k, (name, arguments) in enumerate(self._calls)
        )
        return Reply(text=self._text, calls=tuple(calls))
