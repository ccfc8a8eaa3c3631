"""The routes of OpenAI's Responses API: each response is a turn, found again by its id."""

import secrets
import time
from collections.abc import AsyncGenerator
from typing import Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse, StreamingResponse

from ...tools.errors import InputError
from .hub import AHub, APerson, check_owner
from .openai_answers import USUAL, Answer, Begun, answer_at, base_of, begin, final_answer, problem
from .openai_chat import STREAM, frame
from .openai_request import ResponsesBody, parse_request, place_of
from .sessions import ERRORS

router = APIRouter(prefix="/v1", tags=["openai"], responses=ERRORS)


@router.post("/responses")
async def respond(body: ResponsesBody, request: Request, hub: AHub, person: APerson) -> Response:
    """Answer a message."""
    asked = parse_request(body, request.headers)
    begun = await begin(hub, person, asked, base_of(request, hub))
    facts = _response(begun, body.model) | {"previous_response_id": body.previous_response_id}
    if body.stream:
        return StreamingResponse(_events(begun, facts), 200, STREAM, "text/event-stream")
    return JSONResponse(_completed(await final_answer(begun), facts))


@router.get("/responses/{response}")
async def again(response: str, request: Request, hub: AHub, person: APerson) -> Response:
    """Get an earlier response, rebuilt from its session.

    Answers to a client's own chores, such as titles, and requests for a picture are not kept.
    """
    place = place_of(response)
    if place is None:
        raise InputError(f"The response {response!r} was not kept.", "missing")
    check_owner(place.session, person)
    answer = await answer_at(hub, place, base_of(request, hub))
    return JSONResponse(_completed(answer, _response(answer, USUAL)))


async def _events(begun: Answer | Begun, facts: dict[str, Any]) -> AsyncGenerator[bytes]:
    """Yield the events of a streamed response, in the order of OpenAI's."""
    number = 0

    def event(kind: str, **data: Any) -> bytes:
        nonlocal number
        number += 1
        return frame({"type": kind, "sequence_number": number - 1, **data}, kind)

    item = f"msg_{facts['id'].removeprefix('resp_')}"
    at = {"output_index": 0, "content_index": 0, "item_id": item}
    yield event("response.created", response=facts)
    yield event("response.in_progress", response=facts)
    answer = None
    try:
        async for answer in begun.answers():
            if answer is None:
                yield b": at it\n\n"
    except Exception as error:
        why = {"code": "server_error", "message": problem(error)}
        yield event("error", **why, param=None)
        yield event("response.failed", response={**facts, "status": "failed", "error": why})
    if answer is None:
        return
    text = answer.text
    yield event("response.output_item.added", output_index=0, item=_message(item))
    yield event("response.content_part.added", **at, part=_part(""))
    yield event("response.output_text.delta", **at, delta=text, logprobs=[])
    yield event("response.output_text.done", **at, text=text, logprobs=[])
    yield event("response.content_part.done", **at, part=_part(text))
    yield event("response.output_item.done", output_index=0, item=_message(item, text))
    yield event("response.completed", response=_completed(answer, facts))


def _response(begun: Answer | Begun, model: str) -> dict[str, Any]:
    """Return a response that is still in progress."""
    place = begun.place
    made_of = f"{place.session}_{place.turn}" if place else f"none_{secrets.token_hex(8)}"
    return {
        "id": f"resp_{made_of}",
        "object": "response",
        "created_at": float(int(time.time())),
        "status": "in_progress",
        "model": model,
        "output": [],
        "parallel_tool_calls": False,
        "tool_choice": "none",
        "tools": [],
        "error": None,
        "incomplete_details": None,
        "instructions": None,
        "metadata": {},
        "usage": None,
    }


def _completed(answer: Answer, facts: dict[str, Any]) -> dict[str, Any]:
    """Return a completed response."""
    used, item = answer.usage, f"msg_{facts['id'].removeprefix('resp_')}"
    usage = {
        "input_tokens": used.input_tokens,
        "input_tokens_details": {"cached_tokens": 0, "cache_write_tokens": 0},
        "output_tokens": used.output_tokens,
        "output_tokens_details": {"reasoning_tokens": 0},
        "total_tokens": used.input_tokens + used.output_tokens,
    }
    done = {"status": "completed", "output": [_message(item, answer.text)], "usage": usage}
    return {**facts, **done}


def _message(item: str, text: str | None = None) -> dict[str, Any]:
    """Return the one item of a response; without text while it is in progress."""
    status, content = "in_progress" if text is None else "completed", [_part(text or "")]
    said = {"role": "assistant", "status": status, "content": content if text is not None else []}
    return {"id": item, "type": "message", **said}


def _part(text: str) -> dict[str, Any]:
    return {"type": "output_text", "text": text, "annotations": []}
