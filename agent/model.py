"""The cut between the loop and whatever decides: a model is a name and one method."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from ..tools.errors import ModelError
from ..tools.tool import Tool
from .messages import History, Reply

ShowText = Callable[[str | None], None]
"""Given fragments of text as they come; None: what was shown of this reply is void."""


@dataclass(frozen=True)
class Request:
    """All a model sees: the prompt, the conversation, the tools it may call.

    One that is `aside` is a tool's, about the picture: its reply is no part of the conversation,
    and is not shown.
    """

    system: str
    messages: History
    tools: tuple[Tool, ...]
    aside: bool = False


class Model(Protocol):
    """Anything that answers a request with one complete reply.

    One whose `reads_all` is true is sent all of a long conversation; see `compaction`.
    """

    @property
    def name(self) -> str:
        """What results are recorded under."""
        ...

    async def reply(self, request: Request) -> Reply:
        """Answer.

        Raises:
            ModelError: it cannot.
        """
        ...


async def reply_in_time(model: Model, request: Request, seconds: float | None) -> Reply:
    """The model's reply, whole and within so many seconds.

    Raises:
        ModelError: there is none.
    """
    clock = asyncio.timeout(seconds)
    try:
        async with clock:
            return await model.reply(request)
    except TimeoutError:
        if not clock.expired():
            raise
        raise ModelError(
            f"{model.name} did not finish a reply within {seconds:g} s; "
            "ask again, or allow it more with --limit reply_seconds=NUMBER."
        ) from None
