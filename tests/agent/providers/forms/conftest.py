"""What else the fault server says: thoughts, and replies in the forms that servers really send."""

import asyncio
import json
from typing import Any

import pytest
from formup.agent.messages import Reply, User
from formup.agent.model import Request
from formup.tools.builtin import TOOLS

THOUGHT, SIGN = "A ring. θ=0.785", "c2lnbmF0dXJl+/=="


class Forms:
    """What is the same in all four interfaces, each in its own terms."""

    thoughts: dict[str, list[dict[str, Any]]] = {  # noqa: RUF012
        "openai": [
            {"reasoning_content": THOUGHT},
            {
                "reasoning": THOUGHT,
                "reasoning_details": [
                    {"type": "reasoning.text", "text": THOUGHT, "signature": SIGN, "index": 0},
                    {"type": "reasoning.encrypted", "data": SIGN, "id": "r1", "index": 1},
                ],
            },
            {"extra_content": {"google": {"thought_signature": SIGN}}},
            {"thinking_blocks": [{"type": "thinking", "thinking": THOUGHT, "signature": SIGN}]},
        ],
        "anthropic": [
            {"type": "thinking", "thinking": THOUGHT, "signature": SIGN},
            {"type": "thinking", "thinking": "", "signature": SIGN},
            {"type": "redacted_thinking", "data": SIGN},
        ],
        "openai-responses": [
            {"type": "reasoning", "id": "rs_1", "summary": [], "encrypted_content": SIGN},
            {"type": "reasoning", "content": [{"type": "reasoning_text", "text": THOUGHT}]},
        ],
        "gemini": [
            {"text": THOUGHT, "thought": True, "thoughtSignature": SIGN},
            {"text": "", "thoughtSignature": SIGN},
        ],
    }
    """What a model may think beside its calls; as fields of a message, or as a block of a reply."""

    def with_thought(self, dialect: Any, thought: dict[str, Any], *said: Any) -> dict[str, Any]:
        """A complete body that begins with a thought."""
        body: Any = dialect.body(*said)
        if dialect.name == "openai":
            body["choices"][0]["message"] |= thought
        elif dialect.name == "gemini":
            body["candidates"][0]["content"]["parts"].insert(0, thought)
        else:
            body["content" if dialect.name == "anthropic" else "output"].insert(0, thought)
        return body

    def events(self, dialect: Any, body: Any) -> list[Any]:
        """A complete body as the events that would have brought it."""
        if dialect.name == "gemini":
            end = dialect.frame([], "STOP")
            return [*map(dialect.frame, [[p] for p in self.items(dialect, body)]), end]
        if dialect.name == "openai-responses":
            done = {"type": "response.output_item.done"}
            items = [done | {"item": i, "output_index": n} for n, i in enumerate(body["output"])]
            return [*items, {"type": "response.completed", "response": body | {"output": []}}]
        if dialect.name == "anthropic":
            blocks = [e for n, b in enumerate(body["content"]) for e in _block_events(n, b)]
            stop = {"delta": {"stop_reason": body["stop_reason"]}, "type": "message_delta"}
            return [{"type": "message_start", "message": {"usage": body["usage"]}}, *blocks, stop]
        message = body["choices"][0]["message"]
        chunks = [{"choices": [{"index": 0, "delta": d}]} for d in _deltas(message)]
        return [*chunks, {"choices": [{"index": 0, "delta": {}, "finish_reason": "stop"}]}]

    def items(self, dialect: Any, body: Any) -> list[dict[str, Any]]:
        """The parts of a reply, in a body or sent back in a request."""
        if dialect.name == "gemini":
            turns = body.get("contents", [c["content"] for c in body.get("candidates", ())])
            return [part for turn in turns if turn["role"] == "model" for part in turn["parts"]]
        if dialect.name == "openai-responses":
            return [i for i in body["input"] if i.get("role") != "user" and "output" not in i]
        said = [m for m in body["messages"] if m["role"] == "assistant"]
        return said if dialect.name == "openai" else [b for m in said for b in m["content"]]

    def ids(self, dialect: Any, sent: dict[str, Any]) -> tuple[list[str], list[str]]:
        """Ids of the calls and of the results in a request."""
        turns: list[Any] = sent[dialect.turns]
        if dialect.name == "openai-responses":
            kinds = ("function_call", "function_call_output")
            first, second = ([i["call_id"] for i in turns if i.get("type") == k] for k in kinds)
        elif dialect.name == "openai":
            first = [c["id"] for m in turns for c in m.get("tool_calls", ())]
            second = [m["tool_call_id"] for m in turns if m["role"] == "tool"]
        elif dialect.name == "anthropic":
            blocks = [block for turn in turns for block in turn["content"]]
            first = [b["id"] for b in blocks if b["type"] == "tool_use"]
            second = [b["tool_use_id"] for b in blocks if b["type"] == "tool_result"]
        else:
            parts = [part for turn in turns for part in turn["parts"]]
            kinds = ("functionCall", "functionResponse")
            first, second = ([p[k]["id"] for p in parts if k in p] for k in kinds)
        return first, second

    def ask(self, model: Any, *messages: Any) -> Reply:
        """A model's reply to a history, with all tools offered."""

        async def asking() -> Reply:
            try:
                return await model.reply(Request("", messages or (User(text="go"),), TOOLS))
            finally:
                await model.aclose()

        return asyncio.run(asking())

    def raw(self, body: bytes, kind: str) -> bytes:
        """A response of these bytes, under any content type."""
        head = f"HTTP/1.1 200 X\r\ncontent-type: {kind}\r\ncontent-length: {len(body)}\r\n\r\n"
        return head.encode() + body


def _block_events(index: int, block: dict[str, Any]) -> list[dict[str, Any]]:
    """A block of Anthropic's in fragments, as far as it comes in such."""
    names = {"thinking": "thinking_delta", "signature": "signature_delta", "text": "text_delta"}
    growing = names.keys() & block.keys()
    start: dict[str, Any] = block | dict.fromkeys(growing, "")
    at = {"index": index}
    deltas: list[dict[str, Any]] = [
        {"type": names[name], name: piece}
        for name in sorted(growing, reverse=True)  # a signature comes after what it signs
        for piece in (block[name][:5], block[name][5:])
    ]
    if block["type"] == "tool_use":
        start = start | {"input": {}}
        given = block["input"]
        text = given if isinstance(given, str) else json.dumps(given)
        deltas = [{"type": "input_json_delta", "partial_json": text}]
    begun: dict[str, Any] = {"type": "content_block_start", "content_block": start}
    return [begun | at, *({"type": "content_block_delta", "delta": d} | at for d in deltas)]


def _deltas(message: dict[str, Any]) -> list[dict[str, Any]]:
    """A chat message in fragments: texts in two, signed things after their texts."""
    deltas: list[dict[str, Any]] = []
    for name, value in message.items():
        if isinstance(value, str):
            deltas += [{name: value[:5]}, {name: value[5:]}]
        elif name in ("reasoning_details", "thinking_blocks"):
            for item in value:
                text = {k: item[k] for k in ("text", "thinking") if k in item}
                head = {k: v for k, v in item.items() if k in ("type", "index")}
                deltas += [{name: [head | {k: v[:5]}]} for k, v in text.items()]
                rest = {k: v for k, v in item.items() if k not in text}
                deltas.append({name: [rest | {k: v[5:] for k, v in text.items()}]})
        elif name == "tool_calls":
            deltas += [{name: [call | {"index": n}]} for n, call in enumerate(value)]
        elif value is not None:
            deltas.append({name: value})
    return deltas


@pytest.fixture
def forms() -> Forms:
    return Forms()


@pytest.fixture
def dialects(openai: Any, responses: Any, anthropic: Any, gemini: Any) -> dict[str, Any]:
    return {each.name: each for each in (openai, responses, anthropic, gemini)}
