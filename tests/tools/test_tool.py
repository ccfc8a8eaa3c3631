"""A tool call puts a world in place only while somebody waits for it."""

import asyncio
import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from formup.tools.context import Context
from formup.tools.errors import ToolError
from formup.tools.perception.image import picture_from_array
from formup.tools.tool import THREAD, Tool, in_thread, tool
from formup.tools.world import World

CONTEXT = Context.of(picture_from_array(np.full((40, 60, 3), 90, np.uint8)))


def measuring(work: Callable[[Context], None]) -> tuple[Tool, Tool]:
    """A plain tool and an async one that do the same work in a thread."""

    @tool("read")
    def plain(context: Context) -> dict[str, int]:
        """Measures something."""
        work(context)
        return {}

    @tool("commit")
    async def waiting(context: Context) -> dict[str, int]:
        """Measures something, in a thread of its own."""
        await in_thread(lambda: work(context))
        return {}

    return plain, waiting


def observing(context: Context) -> None:
    context.observed(context.world.with_sample([(1.0, 2.0)])[0])


def refusing(context: Context) -> None:
    observing(context)
    raise ToolError("It is not there.")


@pytest.mark.parametrize("number", [0, 1])
def test_what_was_observed_is_put_in_place_at_once_though_the_call_fails(number: int) -> None:
    worlds: list[World] = []
    context = replace(CONTEXT, observed=worlds.append)
    with pytest.raises(ToolError, match="not there"):
        asyncio.run(measuring(refusing)[number].call(context, {}))
    assert [list(world.samples) for world in worlds] == [["s1"]]
    assert context.world.samples == {}


@pytest.mark.parametrize("number", [0, 1])
def test_a_call_that_was_given_up_puts_nothing_in_place_later(number: int) -> None:
    worlds: list[World] = []
    begun, go_on, ended = threading.Event(), threading.Event(), threading.Event()

    def slow(context: Context) -> None:
        begun.set()
        assert go_on.wait(60)
        observing(context)
        ended.set()

    async def given_up() -> None:
        context = replace(CONTEXT, observed=worlds.append)
        call = asyncio.create_task(measuring(slow)[number].call(context, {}))
        assert await asyncio.to_thread(begun.wait, 60)
        assert any(thread.name == THREAD for thread in threading.enumerate())
        call.cancel()
        with pytest.raises(asyncio.CancelledError):
            await call
        go_on.set()
        assert await asyncio.to_thread(ended.wait, 60)

    asyncio.run(given_up())
    assert worlds == []
