"""The routes of sessions: begin with a picture, list, rename, fork, delete; plans and files."""

import asyncio
import io
from collections.abc import Collection
from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from PIL import Image, UnidentifiedImageError

from ...agent.session import Run
from ...agent.store.protocol import owner_of
from ...tools.draw import draw_plan
from ...tools.errors import InputError
from ...tools.perception.image import Picture, picture_from_bytes
from .forms import AgentFacts, Error, Fork, Name, SessionFacts, SessionState, TurnState, Waits
from .hub import AHub, APerson, Hub, check_owner, check_seen, require_scope
from .tokens import Person

ERRORS: dict[int | str, dict[str, Any]] = {
    401: {"model": Error, "description": "The token is missing or unknown"},
    403: {
        "model": Error,
        "description": "Not allowed for this token, or for pages of another origin",
    },
    404: {"model": Error, "description": "Not found, or it belongs to another token"},
    408: {"model": Error, "description": "The request did not arrive in time"},
    409: {
        "model": Error,
        "description": "A turn is running, or the request conflicts with what was done before",
    },
    413: {"model": Error, "description": "The request or its picture is too large"},
    421: {"model": Error, "description": "The server does not answer to this host name"},
    422: {"model": Error, "description": "The input is not valid; the message says why"},
    429: {"model": Error, "description": "Too many requests, sessions or event streams"},
    500: {"model": Error, "description": "The store cannot be used"},
}
PICTURE = {
    "requestBody": {
        "required": True,
        "content": {
            kind: {"schema": {"type": "string", "format": "binary"}}
            for kind in ("image/jpeg", "image/png", "image/webp", "application/octet-stream")
        },
    }
}
router = APIRouter(prefix="/api", tags=["sessions"], responses=ERRORS)


async def picture_sent(request: Request, hub: Hub, name: str) -> Picture:
    """Return the picture that is the body of a request.

    Raises:
        InputError: as of `checked_picture`.
    """
    return await asyncio.to_thread(checked_picture, await request.body(), name, hub)


def checked_picture(data: bytes, name: str, hub: Hub) -> Picture:
    """Decode a picture from a client, after checking its size.

    Raises:
        InputError: it is not a picture that can be used, or larger than the server allows.
    """
    try:
        with Image.open(io.BytesIO(data)) as header:
            width, height = header.size
    except (UnidentifiedImageError, OSError, ValueError):
        width = height = 0  # the decoder below raises the error
    if width * height > hub.settings.pixels:
        raise InputError(
            f"The picture has {width} by {height} pixels; at most {hub.settings.pixels:,} are "
            "allowed.",
            "too_large",
        )
    return picture_from_bytes(data, name)


@router.get("/agents")
async def agents(hub: AHub, person: APerson) -> list[AgentFacts]:
    """List the agents that can decide in a session; the first is the default."""
    found = hub.service.agents.items()
    return [AgentFacts(name=name, model=agent.model.name) for name, agent in found]


@router.post("/sessions", status_code=201, openapi_extra=PICTURE)
async def begin(
    request: Request,
    hub: AHub,
    person: APerson,
    name: Annotated[str, Query(max_length=200)] = "",
    agent: Annotated[str | None, Query(max_length=200)] = None,
    robots: Annotated[int | None, Query(ge=1, le=10_000)] = None,
    metres_per_pixel: Annotated[float | None, Query(gt=0, le=1e6)] = None,
    robot_radius: Annotated[float | None, Query(ge=0, le=1e5)] = None,
    clearance: Annotated[float | None, Query(ge=0, le=1e5)] = None,
    seed: Annotated[int, Query(ge=0, le=2**31)] = 0,
) -> SessionState:
    """Begin a session about the picture in the request body."""
    require_scope(person, "plan")
    await asyncio.to_thread(check_room, hub, person)
    picture = await picture_sent(request, hub, name or "picture")
    settings = hub.settings.of_session(
        robots=robots,
        metres_per_pixel=metres_per_pixel,
        robot_radius=robot_radius,
        clearance=clearance,
        seed=seed,
    )
    made = await asyncio.to_thread(
        lambda: hub.service.open(
            picture, settings=settings, name=name, agent=agent, owner=person.name
        )
    )
    return await state_of(hub, made, person)


def check_room(hub: Hub, person: Person) -> None:
    """Refuse another session to a token that has as many as allowed.

    Raises:
        InputError: it has as many (`too_many`).
    """
    number, most = len(owned(hub, person)), hub.settings.sessions
    if number >= most:
        raise InputError(f"You have {number} of {most} allowed sessions; delete some.", "too_many")


def owned(
    hub: Hub, person: Person, text: str = "", also: Collection[str] = ()
) -> list[SessionFacts]:
    """Return a person's sessions whose names or words contain a text, the newest first.

    Args:
        also: ids of sessions of others to include.
    """
    found = hub.service.store.sessions(text)
    return [
        SessionFacts(**asdict(f)) for f in found if owner_of(f.id) == person.name or f.id in also
    ]


@router.get("/sessions")
async def listed(
    hub: AHub, person: APerson, text: Annotated[str, Query(max_length=200)] = ""
) -> list[SessionFacts]:
    """List your sessions, newest first; with scope `approve`, also those that wait for approval."""
    waiting = hub.service.waiting() if person.may("approve") else ()
    return await asyncio.to_thread(owned, hub, person, text, waiting)


@router.get("/sessions/{session}")
async def state(session: str, hub: AHub, person: APerson) -> SessionState:
    """Get the current state of a session."""
    return await state_of(hub, await check_seen(hub, session, person), person)


async def state_of(hub: Hub, session: str, person: Person) -> SessionState:
    """Return the current state of a session, as the person who asks gets it.

    Raises:
        InputError: there is no such session.
    """
    held = await hub.service.fresh(session)
    run, turn = held.run, hub.service.turn(session)
    now = turn and TurnState(
        turn=turn.number, status="running", by=turn.asked.by, moving=turn.moving.is_set()
    )
    return SessionState(
        id=session,
        agent=held.agent.model.name,
        scope=person.scope,
        events=held.begun if run is None else run.events or 0,
        under_way=now,
        last=run and run.report,
        waits=None if now else Waits.of(await hub.service.waits(session)),
        plans=() if run is None else tuple(run.world.plans),
        current=None if run is None else run.world.current,
    )


@router.patch("/sessions/{session}")
async def rename(session: str, to: Name, hub: AHub, person: APerson) -> SessionState:
    """Rename a session."""
    require_scope(person, "plan")
    mine = check_owner(session, person)
    await asyncio.to_thread(hub.service.store.rename, mine, to.name)
    return await state_of(hub, session, person)


@router.delete("/sessions/{session}", status_code=204)
async def delete(session: str, hub: AHub, person: APerson) -> None:
    """Hold a session's robots, and delete the session with all its content."""
    require_scope(person, "plan")
    await hub.service.delete(check_owner(session, person))


@router.post("/sessions/{session}/forks", status_code=201)
async def fork(session: str, at: Fork, hub: AHub, person: APerson) -> SessionState:
    """Copy a session, up to a turn, into a new one."""
    require_scope(person, "plan")
    await asyncio.to_thread(check_room, hub, person)
    mine = check_owner(session, person)
    made = await asyncio.to_thread(hub.service.fork, mine, at.turn)
    return await state_of(hub, made, person)


@router.get("/sessions/{session}/plans/{plan_id}")
async def plan(session: str, plan_id: str, hub: AHub, person: APerson) -> dict[str, Any]:
    """Get a plan with its certificate and the plan that it was made from."""
    run = await _run_with(session, plan_id, hub, person)
    void = run.world.is_void(run.world.plans[plan_id].plan)
    return {**run.world.plans[plan_id].model_dump(mode="json"), "void": void}


@router.get(
    "/sessions/{session}/plans/{plan_id}/picture",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}}},
)
async def plan_picture(session: str, plan_id: str, hub: AHub, person: APerson) -> Response:
    """Get a plan drawn on the picture, as PNG."""
    run = await _run_with(session, plan_id, hub, person)
    node, file = run.world.plans[plan_id], io.BytesIO()
    drawn = await asyncio.to_thread(
        draw_plan, run.context.picture, run.world, node.plan, node.words
    )
    drawn.save(file, "PNG")
    return Response(file.getvalue(), media_type="image/png")


async def _run_with(session: str, plan_id: str, hub: Hub, person: Person) -> Run:
    run = (await hub.service.fresh(await check_seen(hub, session, person))).run
    if run is None or plan_id not in run.world.plans:
        raise InputError(f"There is no plan {plan_id!r} in this session.", "missing")
    return run


@router.get(
    "/sessions/{session}/artefacts/{sha256}",
    response_class=Response,
    responses={200: {"content": {"application/octet-stream": {}}}},
)
async def artefact(
    session: str,
    sha256: Annotated[str, Path(pattern="^[0-9a-f]{64}$")],
    hub: AHub,
    person: APerson,
) -> Response:
    """Get a file that events name by its hash: a picture, or the recorded tracks of robots."""
    files = hub.service.store.open(check_owner(session, person)).artefacts
    if sha256 not in files:
        raise InputError(f"There is no file {sha256[:16]} in this session.", "missing")
    data = await asyncio.to_thread(files.get, sha256)
    kind = "image/png" if data.startswith(b"\x89PNG") else "application/octet-stream"
    return Response(data, media_type=kind, headers={"Cache-Control": "private, immutable"})
