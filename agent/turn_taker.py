"""What a conversation needs of an agent; it may be another object than `Agent`."""

from collections.abc import Awaitable, Callable
from typing import Protocol

from .model import Model
from .session import Run


class TurnTaker(Protocol):
    """What takes turns: an `Agent`, whose methods these are."""

    model: Model

    @property
    def arun(self) -> Callable[..., Awaitable[Run]]:
        """See `Agent.arun`."""
        ...

    @property
    def asay(self) -> Callable[..., Awaitable[Run]]:
        """See `Agent.asay`."""
        ...

    @property
    def aresume(self) -> Callable[..., Awaitable[Run]]:
        """See `Agent.aresume`."""
        ...

    async def aclose(self) -> None:
        """See `Agent.aclose`."""
        ...
