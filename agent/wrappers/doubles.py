"""Models for tests: scripted replies, or a function in a model's place."""

from collections.abc import Callable, Sequence

from ...tools.errors import ModelError
from ..messages import Reply
from ..model import Request


class ScriptedModel:
    """A model that gives its replies one after another; `requests` holds what it was asked."""

    def __init__(self, replies: Sequence[Reply], name: str = "scripted") -> None:
        self.name = name
        self._replies = list(replies)
        self.requests: list[Request] = []

    async def reply(self, request: Request) -> Reply:
        """Return the next reply.

        Raises:
            ModelError: there is none left.
        """
        self.requests.append(request)
        if len(self.requests) > len(self._replies):
            raise ModelError(f"The script has {len(self._replies)} replies; one more was wanted.")
        return self._replies[len(self.requests) - 1]

    def assert_complete(self) -> None:
        """Fail a test that left replies unused."""
        used, there = len(self.requests), len(self._replies)
        assert used == there, f"{there - used} of {there} scripted replies were not used"


class FunctionModel:
    """A model that calls a function."""

    def __init__(self, function: Callable[[Request], Reply], name: str = "function") -> None:
        self.name = name
        self._function = function

    async def reply(self, request: Request) -> Reply:
        """Return what the function returns."""
        return self._function(request)
