"""The floor: a bare httpx loop with json, and nothing else."""

import json
from typing import Any

import httpx
from task import DESCRIPTION, SYSTEM, USER, compute

NUMBER = {"type": "number"}
POINT = {"label": {"type": "string"}, "x": NUMBER, "y": NUMBER}
POINT_SCHEMA = {"type": "object", "required": ["label", "x", "y"], "properties": POINT}
POINTS = {"type": "array", "items": POINT_SCHEMA, "description": "the points to check"}
PARAMETERS = {"type": "object", "required": ["points"], "properties": {"points": POINTS}}
FUNCTION = {"name": "check_points", "description": DESCRIPTION, "parameters": PARAMETERS}
TOOLS = [{"type": "function", "function": FUNCTION}]
_clients: list[httpx.AsyncClient] = []


def _client() -> httpx.AsyncClient:
    if not _clients:
        _clients.append(httpx.AsyncClient(timeout=60, headers={"authorization": "Bearer k"}))
    return _clients[0]


def _call(arguments: str) -> str:
    return compute((p["x"], p["y"]) for p in json.loads(arguments)["points"])


async def run(base_url: str) -> str:
    """A conversation."""
    messages: list[Any] = [{"role": "system", "content": SYSTEM}, {"role": "user", "content": USER}]
    while True:
        body = {"model": "bench-model", "messages": messages, "tools": TOOLS}
        response = await _client().post(base_url + "/chat/completions", json=body)
        response.raise_for_status()
        message = response.json()["choices"][0]["message"]
        if not message.get("tool_calls"):
            return message["content"]
        messages.append(message)
        for call in message["tool_calls"]:
            text = _call(call["function"]["arguments"])
            messages.append({"role": "tool", "tool_call_id": call["id"], "content": text})


async def run_stream(base_url: str) -> str:
    """A conversation, streamed."""
    messages: list[Any] = [{"role": "system", "content": SYSTEM}, {"role": "user", "content": USER}]
    options = {"stream": True, "stream_options": {"include_usage": True}}
    while True:
        body = {"model": "bench-model", "messages": messages, "tools": TOOLS} | options
        text, calls = await _turn(base_url + "/chat/completions", body)
        if not calls:
            return text
        messages.append({"role": "assistant", "content": None, "tool_calls": calls})
        for call in calls:
            result = _call(call["function"]["arguments"])
            messages.append({"role": "tool", "tool_call_id": call["id"], "content": result})


async def _turn(url: str, body: dict[str, Any]) -> tuple[str, list[dict[str, Any]]]:
    text, calls = "", dict[int, dict[str, Any]]()
    async with _client().stream("POST", url, json=body) as response:
        response.raise_for_status()
        async for line in response.aiter_lines():
            if not line.startswith("data: ") or line == "data: [DONE]":
                continue
            choices: list[Any] = json.loads(line[6:])["choices"]
            delta: dict[str, Any] = choices[0]["delta"] if choices else {}
            text += delta.get("content") or ""
            for part in delta.get("tool_calls") or ():
                call = calls.get(part["index"])
                if call is None:
                    function = dict(part["function"])
                    calls[part["index"]] = {
                        "id": part["id"],
                        "type": "function",
                        "function": function,
                    }
                else:
                    call["function"]["arguments"] += part["function"]["arguments"]
    return text, list(calls.values())
