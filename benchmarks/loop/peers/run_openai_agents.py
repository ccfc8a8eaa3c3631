"""openai-agents: Runner with one function tool over Chat Completions, without tracing."""

from functools import cache

from agents import (
    Agent,
    OpenAIChatCompletionsModel,
    Runner,
    function_tool,
    set_tracing_disabled,
)
from exchange import SYSTEM, USER
from openai import AsyncOpenAI
from typed import check_points

set_tracing_disabled(True)


@cache
def _openai_agent(base_url: str) -> Agent:
    client = AsyncOpenAI(base_url=base_url, api_key="k")
    model = OpenAIChatCompletionsModel(model="bench-model", openai_client=client)
    tools = [function_tool(check_points)]
    return Agent(name="bench", instructions=SYSTEM, tools=tools, model=model)


async def run(base_url: str) -> str:
    """Hold a conversation and return its final text."""
    return (await Runner.run(_openai_agent(base_url), USER, max_turns=1000)).final_output


async def run_stream(base_url: str) -> str:
    """Hold a conversation, streamed, and return its final text."""
    result = Runner.run_streamed(_openai_agent(base_url), USER, max_turns=1000)
    async for _ in result.stream_events():
        pass
    return result.final_output
