"""The cut between the loop and whatever decides: a model is a name and one method."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from ..tools.tool import Tool
from .messages import History, Reply

ShowText = Callable[[str | None], None]
"""Given fragments of text as they come; None: what was shown of this reply is void."""


@dataclass(frozen=True)
class Request:
    """All a model sees: the prompt, the conversation, the tools it may call."""

    system: str
    messages: History
    tools: tuple[Tool, ...]


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
