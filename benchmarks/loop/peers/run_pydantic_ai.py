"""pydantic-ai: an Agent with one typed tool over Chat Completions."""

from functools import cache

from exchange import SYSTEM, USER
from pydantic_ai import Agent
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.providers.openai import OpenAIProvider
from pydantic_ai.usage import UsageLimits
from typed import check_points

UNLIMITED = UsageLimits(request_limit=None)


@cache
def _pydantic_agent(base_url: str) -> Agent:
    model = OpenAIChatModel("bench-model", provider=OpenAIProvider(base_url=base_url, api_key="k"))
    return Agent(model, instructions=SYSTEM, tools=[check_points])


async def run(base_url: str) -> str:
    """Hold a conversation and return its final text."""
    return (await _pydantic_agent(base_url).run(USER, usage_limits=UNLIMITED)).output


async def run_stream(base_url: str) -> str:
    """Hold a conversation, streamed, and return its final text."""
    async with _pydantic_agent(base_url).run_stream(USER, usage_limits=UNLIMITED) as result:
        return await result.get_output()
