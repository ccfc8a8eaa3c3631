"""The interface between the loop and whatever decides: a model is a name and one method."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from ..tools.errors import ModelError
from ..tools.tool import Tool
from .messages import History, Reply

ShowText = Callable[[str | None], None]
"""Called with fragments of text as they arrive; None voids what was shown of this reply."""


@dataclass(frozen=True)
class Request:
    """All a model sees: the prompt, the conversation, the tools it may call.

    A request that is `aside` comes from a tool and is about the picture: its reply is not part of
    the conversation and is not shown.
    """

    system: str
    messages: History
    tools: tuple[Tool, ...]
    aside: bool = False


class Model(Protocol):
    """Anything that answers a request with one complete reply.

    A model whose `reads_all` is true is sent all of a long conversation; see `compaction`.
    """

    @property
    def name(self) -> str:
        """The name that results are recorded under."""
        ...

    async def reply(self, request: Request) -> Reply:
        """Return a complete reply to a request.

        Raises:
            ModelError: the model cannot answer.
        """
        ...


async def reply_in_time(model: Model, request: Request, seconds: float | None) -> Reply:
    """Return the model's complete reply, given within so many seconds; None is no limit.

    Raises:
        ModelError: the model cannot answer, or takes longer.
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
            "ask again, or raise the limit reply_seconds."
        ) from None
