"""The floor: a bare httpx loop with json, and nothing else."""

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
from exchange import DESCRIPTION, SYSTEM, USER, compute

NUMBER = {"type": "number"}
POINT = {"label": {"type": "string"}, "x": NUMBER, "y": NUMBER}
POINT_SCHEMA = {"type": "object", "required": ["label", "x", "y"], "properties": POINT}
POINTS = {"type": "array", "items": POINT_SCHEMA, "description": "the points to check"}
PARAMETERS = {"type": "object", "required": ["points"], "properties": {"points": POINTS}}
FUNCTION = {"name": "check_points", "description": DESCRIPTION, "parameters": PARAMETERS}
TOOLS = [{"type": "function", "function": FUNCTION}]
Json = dict[str, Any]
Turn = Callable[[str, Json], Awaitable[Json]]
_clients: list[httpx.AsyncClient] = []


def _client() -> httpx.AsyncClient:
    if not _clients:
        _clients.append(httpx.AsyncClient(timeout=60, headers={"authorization": "Bearer k"}))
    return _clients[0]


async def run(base_url: str) -> str:
    """Hold a conversation and return its final text."""
    return await _converse(base_url + "/chat/completions", _whole)


async def run_stream(base_url: str) -> str:
    """Hold a conversation, streamed, and return its final text."""
    return await _converse(base_url + "/chat/completions", _streamed)


async def _converse(url: str, turn: Turn) -> str:
    messages: list[Any] = [{"role": "system", "content": SYSTEM}, {"role": "user", "content": USER}]
    while True:
        message = await turn(url, {"model": "bench-model", "messages": messages, "tools": TOOLS})
        if not message.get("tool_calls"):
            return message["content"]
        messages.append(message)
        for call in message["tool_calls"]:
            points = json.loads(call["function"]["arguments"])["points"]
            text = compute((p["x"], p["y"]) for p in points)
            messages.append({"role": "tool", "tool_call_id": call["id"], "content": text})


async def _whole(url: str, body: Json) -> Json:
    response = await _client().post(url, json=body)
    response.raise_for_status()
    return response.json()["choices"][0]["message"]


async def _streamed(url: str, body: Json) -> Json:
    text, calls = "", dict[int, Json]()
    body |= {"stream": True, "stream_options": {"include_usage": True}}
    async with _client().stream("POST", url, json=body) as response:
        response.raise_for_status()
        async for line in response.aiter_lines():
            if not line.startswith("data: ") or line == "data: [DONE]":
                continue
            choices: list[Any] = json.loads(line[6:])["choices"]
            delta: Json = choices[0]["delta"] if choices else {}
            text += delta.get("content") or ""
            for part in delta.get("tool_calls") or ():
                call = calls.get(part["index"])
                if call is None:
                    names = ("id", "type", "function")
                    calls[part["index"]] = {name: part[name] for name in names}
                else:
                    call["function"]["arguments"] += part["function"]["arguments"]
    return {"role": "assistant", "content": text or None, "tool_calls": list(calls.values())}
