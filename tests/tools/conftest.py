"""What tests of tools stand on."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from formup.tools.builtin import TOOLS
from formup.tools.context import Context, Settings
from formup.tools.errors import ToolError
from formup.tools.perception.image import Picture
from formup.tools.tool import ToolResult
from formup.tools.world import World


class ToolCalls:
    """Calls tools one after another, and keeps the world and what was observed as the loop does.

    All count as of one reply, which knows of the doubts that calls before had.
    """

    def __init__(
        self, picture: Picture, words: str = "", world: World | None = None, **settings: Any
    ) -> None:
        made = Context.of(picture, Settings(**settings), world)
        self.context = replace(made, words=words, observed=self.keep, moving=self._moving)
        self.moved: list[str] = []
        """The plans whose motion began."""

    @property
    def world(self) -> World:
        return self.context.world

    def keep(self, world: World) -> None:
        self.context = self.context.at(world)

    def fix(self, **settings: Any) -> None:
        """Change what the person fixed."""
        changed = self.context.settings.model_copy(update=settings)
        self.context = replace(self.context, settings=changed).check()

    async def _moving(self, plan_id: str) -> None:
        self.moved.append(plan_id)

    async def acall(self, name: str, **arguments: Any) -> ToolResult:
        tool = next(t for t in TOOLS if t.name == name)
        try:
            result = await tool.call(self.context, arguments)
        except ToolError as error:
            doubted = self.context.doubted.union(error.facts.get("doubts", ()))
            self.context = replace(self.context, doubted=doubted)
            raise
        if result.world is not None:
            self.keep(result.world)
        if tool.kind == "commit":
            self.context = replace(self.context, proposed=next(reversed(self.world.plans), None))
        return result

    def call(self, name: str, **arguments: Any) -> ToolResult:
        return asyncio.run(self.acall(name, **arguments))


@pytest.fixture
def tool_calls() -> Callable[..., ToolCalls]:
    """Begins calls of tools on a picture; see `ToolCalls`."""
    return ToolCalls
