"""The routes of OpenAI's Chat Completions, of the list of models, and of pictures in answers."""

import asyncio
import secrets
import time
from collections.abc import AsyncGenerator
from typing import Annotated, Any

from fastapi import APIRouter, Path, Request, Response
from fastapi.responses import JSONResponse, StreamingResponse
from pydantic_core import to_json

from ...agent.report import Totals
from ...tools.errors import InputError
from .hub import AHub, APerson, error_data
from .openai_answers import Answer, Begun, agents, base_of, begin, final_answer, problem
from .openai_request import ChatBody, parse_request
from .sessions import ERRORS

router = APIRouter(prefix="/v1", tags=["openai"], responses=ERRORS)
STREAM = {"Cache-Control": "no-cache", "X-Accel-Buffering": "no"}
FOREVER = "private, max-age=31536000, immutable"


@router.get("/models")
async def models(hub: AHub, person: APerson) -> dict[str, Any]:
    """List the agents, as models."""
    return {"object": "list", "data": [_model_facts(name) for name in agents(hub)]}


@router.get("/models/{name:path}")
async def model(name: str, hub: AHub, person: APerson) -> dict[str, Any]:
    """Get one of the models."""
    if name not in agents(hub):
        raise InputError(f"There is no model {name[:80]!r} here.", "missing")
    return _model_facts(name)


@router.post("/chat/completions")
async def complete(body: ChatBody, request: Request, hub: AHub, person: APerson) -> Response:
    """Answer the last message of a conversation."""
    base = base_of(request, hub)
    begun = await begin(hub, person, parse_request(body, request.headers), base)
    facts = {"id": _id(begun), "created": int(time.time()), "model": body.model}
    if body.stream:
        usage = bool((body.stream_options or {}).get("include_usage"))
        return StreamingResponse(_chunks(begun, facts, usage), 200, STREAM, "text/event-stream")
    answer = await final_answer(begun)
    message = {"role": "assistant", "content": answer.text}
    choice = {"index": 0, "message": message, "finish_reason": "stop"}
    whole = {"object": "chat.completion", "choices": [choice], "usage": _usage(answer.usage)}
    return JSONResponse({**facts, **whole})


@router.get(
    "/pictures/{session}/{turn}/{sha256}.png",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}}},
)
async def picture(
    session: str,
    turn: Annotated[int, Path(ge=1, le=2**31)],
    sha256: Annotated[str, Path(pattern="^[0-9a-f]{64}$")],
    hub: AHub,
) -> Response:
    """Get the picture of an answer.

    No token is needed: whoever knows its hash was given the address, or has the picture.
    """
    try:
        files = hub.service.store.open(session).artefacts
        data = await asyncio.to_thread(files.get, sha256)
    except InputError:
        data = b""
    if not data.startswith(b"\x89PNG"):
        raise InputError("There is no such picture.", "missing")
    return Response(data, media_type="image/png", headers={"Cache-Control": FOREVER})


async def _chunks(
    begun: Answer | Begun, facts: dict[str, Any], usage: bool
) -> AsyncGenerator[bytes]:
    """Yield an answer as the chunks of a streamed chat completion."""

    def chunk(*choices: Any, **more: Any) -> bytes:
        kind = {"object": "chat.completion.chunk", "choices": choices}
        return frame({**facts, **kind, **more})

    def part(delta: dict[str, str], end: str | None = None) -> bytes:
        return chunk({"index": 0, "delta": delta, "finish_reason": end})

    yield part({"role": "assistant", "content": ""})
    try:
        async for answer in begun.answers():
            if answer is None:
                yield b": at it\n\n"
                continue
            yield part({"content": answer.text})
            yield part({}, "stop")
            if usage:
                yield chunk(usage=_usage(answer.usage))
    except Exception as error:
        yield frame(error_data(problem(error), None, "server_error"))
        yield part({}, "length")
    yield b"data: [DONE]\n\n"


def frame(data: dict[str, Any], event: str | None = None) -> bytes:
    """Return a server-sent event."""
    named = f"event: {event}\n".encode() if event else b""
    return named + b"data: " + to_json(data) + b"\n\n"


def _id(begun: Answer | Begun) -> str:
    place = begun.place
    return f"chatcmpl-{f'{place.session}-{place.turn}' if place else secrets.token_hex(8)}"


def _usage(used: Totals) -> dict[str, int]:
    given, made = used.input_tokens, used.output_tokens
    return {"prompt_tokens": given, "completion_tokens": made, "total_tokens": given + made}


def _model_facts(name: str) -> dict[str, Any]:
    return {"id": name, "object": "model", "created": 0, "owned_by": "formup"}
