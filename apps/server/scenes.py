"""The routes a page draws from: the picture, things in it, plans as numbers, previews of edits.

Nothing here changes a session; only a turn applies an edit that was tried.
"""

import asyncio
import io
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from PIL import Image

from ...agent.conversation import Session
from ...tools.builtin.editing import previewed
from ...tools.builtin.motions import paths_to
from ...tools.builtin.targets import doubtful, measured
from ...tools.draw.scene import candidate_data, robot_data, scene_data, thing_data, verdict_data
from ...tools.errors import InputError, ToolError
from ...tools.perception.image import Picture
from .forms import Outlined, Pointing, Preview
from .hub import AHub, APerson, Hub, check_owner, check_seen, require_scope
from .sessions import ERRORS
from .tokens import Person

router = APIRouter(prefix="/api/sessions/{session}", tags=["page"], responses=ERRORS)
LONGEST = 2048
"""Longest side, px, of a picture sent to a page; coordinates are those of the original."""


def person_error(error: ToolError) -> InputError:
    """Return a tool's error as an InputError, worded for a person where the tool has such words."""
    return InputError(str(error.facts.get("plain", error)), error.kind)


async def _session(hub: Hub, name: str, person: Person) -> Session:
    return await hub.service.fresh(check_owner(name, person))


@router.get("/picture", response_class=Response, responses={200: {"content": {"image/jpeg": {}}}})
async def picture(session: str, hub: AHub, person: APerson) -> Response:
    """Get the session's current picture, upright, as JPEG of at most 2,048 px a side."""
    held = await hub.service.fresh(await check_seen(hub, session, person))
    shown = held.context.picture
    data = await asyncio.to_thread(_jpeg, shown)
    return Response(data, media_type="image/jpeg", headers={"ETag": f'"{shown.sha256}"'})


def _jpeg(picture: Picture) -> bytes:
    file, image = io.BytesIO(), Image.fromarray(picture.pixels)
    image.thumbnail((LONGEST, LONGEST))
    image.save(file, "JPEG", quality=88)
    return file.getvalue()


@router.get("/scene")
async def scene(
    session: str,
    hub: AHub,
    person: APerson,
    plan: Annotated[str | None, Query(max_length=100)] = None,
) -> dict[str, Any]:
    """Get outlines, robots and a plan with its certificate, in px; by default the current plan."""
    held = await hub.service.fresh(await check_seen(hub, session, person))
    world = held.context.world
    if plan is not None and plan not in world.plans:
        raise InputError(f"There is no plan {plan!r} in this session.", "missing")
    return await asyncio.to_thread(scene_data, world, plan)


@router.get("/plans/{plan_id}/paths")
async def paths(
    session: str, plan_id: str, hub: AHub, person: APerson
) -> dict[str, list[list[float]]]:
    """Get each robot's path to a plan from where it was last observed, in px by robot id."""
    context = (await hub.service.fresh(await check_seen(hub, session, person))).context
    if plan_id not in context.world.plans:
        raise InputError(f"There is no plan {plan_id!r} in this session.", "missing")
    try:
        plan = context.world.plan(plan_id).plan
        found = await asyncio.to_thread(paths_to, context, plan)
    except ToolError as error:
        raise person_error(error) from None
    return {robot: path.round(1).tolist() for robot, path in found.items()}


@router.get("/things")
async def things(session: str, hub: AHub, person: APerson) -> list[dict[str, Any]]:
    """List the things that stand out in the picture; turns reuse what is detected here."""
    context = (await _session(hub, session, person)).context
    return candidate_data(await asyncio.to_thread(context.candidates))


@router.post("/outline")
async def outline(session: str, pointing: Pointing, hub: AHub, person: APerson) -> Outlined:
    """Measure the outline of what is pointed at, with its confidence; changes nothing."""
    require_scope(person, "plan")
    context = (await _session(hub, session, person)).context
    try:
        found = await asyncio.to_thread(measured, context, pointing.prompt)
    except ToolError as error:
        raise person_error(error) from None
    _, target, threshold = found
    return Outlined(
        **thing_data(target.id, target.label, target.outline),
        confidence=target.confidence,
        threshold=threshold,
        sound=target.confidence >= threshold,
        doubtful=doubtful(target),
    )


@router.post("/preview")
async def preview(session: str, wanted: Preview, hub: AHub, person: APerson) -> dict[str, Any]:
    """Preview edits of a plan: the robots' places and the certificate; changes nothing."""
    require_scope(person, "plan")
    world = (await _session(hub, session, person)).context.world
    try:
        plan = await asyncio.to_thread(previewed, world, wanted.edits, wanted.plan_id)
    except ToolError as error:
        raise person_error(error) from None
    return verdict_data(plan) | {"robots": robot_data(plan)}
