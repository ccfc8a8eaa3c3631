"""smolagents: a ToolCallingAgent over Chat Completions, run in threads, as it is not async."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from functools import cache

from exchange import USER, compute
from smolagents import OpenAIModel, ToolCallingAgent, tool
from smolagents.memory import FinalAnswerStep
from smolagents.monitoring import LogLevel

_pool = ThreadPoolExecutor(64)


@tool
def check_points(points: list[dict]) -> str:
    """Count the points that lie inside the unit circle.

    Args:
        points: the points to check
    """
    return compute((p["x"], p["y"]) for p in points)


@cache
def _model(base_url: str) -> OpenAIModel:
    return OpenAIModel(model_id="bench-model", api_base=base_url, api_key="k")


def _smol_agent(base_url: str, streams: bool) -> ToolCallingAgent:
    """Make an agent for one run, whose memory it holds; the model is shared."""
    agent = ToolCallingAgent(
        tools=[check_points],
        model=_model(base_url),
        max_steps=1000,
        verbosity_level=LogLevel.OFF,
        stream_outputs=streams,
    )
    agent.logger.console.quiet = True  # otherwise streamed text goes to the terminal
    return agent


def _smol_run(base_url: str) -> str:
    return _smol_agent(base_url, False).run(USER)


def _run_stream(base_url: str) -> str:
    steps = _smol_agent(base_url, True).run(USER, stream=True)
    return next(step.output for step in steps if isinstance(step, FinalAnswerStep))


async def run(base_url: str) -> str:
    """Hold a conversation and return its final text."""
    return await asyncio.get_running_loop().run_in_executor(_pool, _smol_run, base_url)


async def run_stream(base_url: str) -> str:
    """Hold a conversation, streamed, and return its final text."""
    return await asyncio.get_running_loop().run_in_executor(_pool, _run_stream, base_url)
