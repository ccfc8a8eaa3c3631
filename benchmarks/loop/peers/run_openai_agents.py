"""openai-agents: Runner with one function tool over Chat Completions, its tracing off."""

from functools import cache

from agents import (
    Agent,
    OpenAIChatCompletionsModel,
    Runner,
    function_tool,
    set_tracing_disabled,
)
from openai import AsyncOpenAI
from pydantic import BaseModel
from task import SYSTEM, USER, compute

set_tracing_disabled(True)


class Point(BaseModel):
    """One of them."""

    label: str
    x: float
    y: float


@function_tool
async def check_points(points: list[Point]) -> str:
    """Count the points that lie inside the unit circle."""
    return compute((p.x, p.y) for p in points)


@cache
def _agent(base_url: str) -> Agent:
    client = AsyncOpenAI(base_url=base_url, api_key="k")
    model = OpenAIChatCompletionsModel(model="bench-model", openai_client=client)
    return Agent(name="bench", instructions=SYSTEM, tools=[check_points], model=model)


async def run(base_url: str) -> str:
    """A conversation."""
    return (await Runner.run(_agent(base_url), USER, max_turns=1000)).final_output


async def run_stream(base_url: str) -> str:
    """A conversation, streamed."""
    result = Runner.run_streamed(_agent(base_url), USER, max_turns=1000)
    async for _ in result.stream_events():
        pass
    return result.final_output
