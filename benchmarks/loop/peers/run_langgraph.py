"""langgraph: langchain's create_agent with one tool over Chat Completions, without tracing."""

import os
from functools import cache
from typing import Any

from exchange import SYSTEM, USER
from langchain.agents import create_agent
from langchain_core.tools import tool
from langchain_openai import ChatOpenAI
from typed import check_points

os.environ["LANGSMITH_TRACING"] = "false"
DEEP = {"recursion_limit": 5000}


@cache
def _langgraph_agent(base_url: str, streams: bool) -> Any:
    model = ChatOpenAI(
        model="bench-model",
        base_url=base_url,
        api_key="k",
        use_responses_api=False,
        streaming=streams,
        stream_usage=streams,
    )
    return create_agent(model, tools=[tool(check_points)], system_prompt=SYSTEM)


def _asked() -> dict[str, Any]:
    return {"messages": [{"role": "user", "content": USER}]}


async def run(base_url: str) -> str:
    """Hold a conversation and return its final text."""
    result = await _langgraph_agent(base_url, False).ainvoke(_asked(), DEEP)
    return result["messages"][-1].content


async def run_stream(base_url: str) -> str:
    """Hold a conversation, streamed, and return the joined fragments of its last message."""
    texts: dict[str, str] = {}
    stream = _langgraph_agent(base_url, True).astream(_asked(), DEEP, stream_mode="messages")
    async for message, _ in stream:
        texts[message.id] = texts.get(message.id, "") + message.text
    return list(texts.values())[-1]
