"""The event stream of a session, as server-sent events; it can resume after any of them.

Types are AG-UI's, or `CUSTOM` where it has none. The id of an event is the number of the session's
event and its index among those made from it; poses have no id, as only the latest counts.
"""

from collections.abc import AsyncIterable, Iterator, Mapping, Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent
from pydantic_core import to_json

from ...agent.feed import Poses
from ...agent.store.protocol import Event
from ...tools.errors import InputError
from .hub import AHub, APerson, check_owner
from .sessions import ERRORS

router = APIRouter(prefix="/api/sessions/{session}", tags=["events"], responses=ERRORS)
BEGINS = ("turn", "resume")


class Place:
    """Where a stream resumes.

    Args:
        number: of the last event of the session that was seen whole.
        seen: how many of the stream's events made from the next one were seen too.
    """

    def __init__(self, number: int, seen: int) -> None:
        self.number, self.seen = number, seen


async def place_of(
    session: str,
    hub: AHub,
    person: APerson,
    after: Annotated[int, Query(ge=0, le=2**31)] = 0,
    last: Annotated[str | None, Header(alias="Last-Event-ID", max_length=40)] = None,
) -> Place:
    """Return where a client's stream resumes; checks the request before the stream begins.

    Raises:
        InputError: they have no such session, too many streams are open (`too_many`), or
            Last-Event-ID is malformed.
    """
    await hub.service.fresh(check_owner(session, person))
    if hub.streams >= hub.settings.streams:
        raise InputError(
            f"All {hub.streams} event streams that are allowed are open; close one, or wait.",
            "too_many",
        )
    if last is None:
        return Place(after, 0)
    number, _, part = last.partition(".")
    if not number.isascii() or not number.isdecimal() or not (part or "0").isdecimal():
        raise InputError(f"Last-Event-ID is {last[:20]!r}; give the id of an event of this server.")
    return Place(int(number) - 1, int(part or 0) + 1)


@router.get("/events", response_class=EventSourceResponse)
async def events(
    session: str,
    hub: AHub,
    place: Annotated[Place, Depends(place_of)],
    watching: Annotated[
        bool, Query(description="whether simulated robots drive in real time")
    ] = False,
) -> AsyncIterable[ServerSentEvent]:
    """Stream all events after a given one, and the robots' poses while they drive."""
    run = _run_before(hub.service.events(session), place.number) if place.number > 0 else 0
    hub.streams += 1
    hub.metrics.streams.inc()
    try:
        async for told in hub.service.follow(session, max(place.number, 0), watching=watching):
            if isinstance(told, Poses):
                yield _event(poses_data(told), None)
            else:
                run = told.number if told.kind in BEGINS else run
                for part, data in enumerate(frames(session, told, run)):
                    if told.number != place.number + 1 or part >= place.seen:
                        yield _event(data, f"{told.number}.{part}")
    finally:
        hub.streams -= 1
        hub.metrics.streams.dec()


def _event(data: Mapping[str, Any], id: str | None) -> ServerSentEvent:
    return ServerSentEvent(data=data, event=str(data["type"]), id=id)


def _run_before(events: Sequence[Event], number: int) -> int:
    """Return the number of the turn that the event of a number belongs to; 0 before any turn."""
    return max((e.number for e in events[:number] if e.kind in BEGINS), default=0)


def poses_data(told: Poses) -> dict[str, Any]:
    """Return robots' poses as an event: px, and radians clockwise from the x axis."""
    poses = [{"id": p.id, "x": p.x, "y": p.y, "heading": p.heading} for p in told.poses]
    return {"type": "CUSTOM", "name": "poses", "value": {"number": told.number, "poses": poses}}


def frames(session: str, event: Event, run: int) -> Iterator[dict[str, Any]]:
    """Yield an event of a session as AG-UI's events.

    Args:
        run: the number of the event that began its turn.
    """
    data, ids = event.data, {"threadId": session, "runId": str(run)}
    if event.kind in BEGINS:
        said = {"words": data.get("words"), "by": data.get("by"), "key": data.get("key")}
        yield {"type": "RUN_STARTED", **ids, "input": said}
    elif event.kind == "message":
        yield from _message_frames(f"m{event.number}", data)
    elif event.kind != "end":
        yield {"type": "CUSTOM", "name": event.kind, "value": data}
    elif data["status"] in ("failed", "stopped"):
        yield {"type": "RUN_ERROR", **ids, "message": data["message"], "code": data["status"]}
    else:
        yield {"type": "RUN_FINISHED", **ids, "result": data}


def _message_frames(id: str, data: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    role = data["role"]
    if role == "tool":
        content = {"toolCallId": data["call_id"], "content": data.get("text", "")}
        yield {"type": "TOOL_CALL_RESULT", "messageId": id, "role": "tool", **content}
        return
    if text := data.get("text"):
        yield {"type": "TEXT_MESSAGE_START", "messageId": id, "role": role}
        yield {"type": "TEXT_MESSAGE_CONTENT", "messageId": id, "delta": text}
        yield {"type": "TEXT_MESSAGE_END", "messageId": id}
    for call in data.get("calls", ()):
        named = {"toolCallId": call["id"]}
        yield {
            "type": "TOOL_CALL_START",
            **named,
            "toolCallName": call["name"],
            "parentMessageId": id,
        }
        yield {"type": "TOOL_CALL_ARGS", **named, "delta": _json(call["arguments"])}
        yield {"type": "TOOL_CALL_END", **named}


def _json(value: Any) -> str:
    return to_json(value).decode()
