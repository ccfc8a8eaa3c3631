"""The tools that a client sees: few, each one thing a person wants of the whole team.

No argument of any of them is a person's yes: words plan and never move robots here, and real ones
are driven only after a person was asked, see `approving`.
"""

from typing import Annotated, Any

from mcp.server import MCPServer
from mcp.server.mcpserver import (
    AcceptedElicitation,
    CancelledElicitation,
    DeclinedElicitation,
    Resolve,
)
from mcp_types import ToolAnnotations
from pydantic import Field, WithJsonSchema

from ...agent.turns import Asked
from ...tools.context import Context as ToolContext
from ...tools.context import Settings
from ...tools.errors import InputError
from ...tools.formation.editing.edit_kinds import EDIT_SCHEMA
from ..server.forms import Key, Pointed, Words
from ..server.hub import asked_by, need
from ..server.sessions import check_room
from .access import Access, Ctx, caller, picture_named, theirs, told
from .approving import Yes, ask_person, key_of_yes
from .state import Told, after, standing

NO_GO = (
    "Nothing was done: words move no robots here. Say it without the go, and have the certified "
    "plan driven with approve_and_deploy."
)
ASession = Annotated[str, Field(max_length=100, description="as open_scene gave it")]
AKey = Annotated[Key, Field(description="of your choice, the same when you repeat this very call")]
Detail = Annotated[bool, Field(description="also contract, positions, certificate, arrival")]
Shown = Annotated[bool, Field(description="also the picture of what stands")]
Things = Annotated[Pointed, Field(description="things meant, pointed at in px of the picture")]
Answer = AcceptedElicitation[Any] | DeclinedElicitation | CancelledElicitation
Edits = Annotated[
    list[Annotated[dict[str, Any], WithJsonSchema(EDIT_SCHEMA)]], Field(min_length=1, max_length=20)
]


@told
async def open_scene(
    ctx: Ctx,
    image: Annotated[str, Field(description="path of a file, or over HTTP an id; or a data URL")],
    robots: Annotated[int | None, Field(ge=1, le=10_000)] = None,
    metres_per_pixel: Annotated[float | None, Field(gt=0, le=1e6)] = None,
    robot_radius: Annotated[float | None, Field(ge=0, le=1e5, description="px")] = None,
    clearance: Annotated[float | None, Field(ge=0, le=1e5, description="px")] = None,
    picture: Shown = False,
) -> Told:
    """Begin a session about a picture taken from above; everything else needs its id."""
    hub, person = caller(ctx)
    need(person, "plan")
    check_room(hub, person)
    seen = await picture_named(ctx, image)
    settings = Settings(
        robots=robots,
        metres_per_pixel=metres_per_pixel,
        robot_radius=robot_radius,
        clearance=clearance,
        fleet=hub.settings.fleet,
    )
    ToolContext.of(seen, settings)  # what cannot be is said before anything is kept
    made = hub.service.open(seen, settings=settings, owner=person.name)
    return await standing(ctx, made, picture=picture)


@told
async def instruct(
    ctx: Ctx,
    session: ASession,
    words: Words,
    points: Things = (),
    idempotency_key: AKey | None = None,
    detail: Detail = False,
    picture: Shown = False,
) -> Told:
    """Say in the person's own words what the team shall do or change; also questions and answers.

    It plans and certifies; no robot moves. "Surround the coin with 6 robots", "a bit further out",
    "undo", "how far is robot 4?".
    """
    hub, person = caller(ctx)
    need(person, "plan")
    await theirs(ctx, session)
    asked = Asked(by=person.name, key=idempotency_key, may_move=False)
    turn = hub.service.say(session, words, asked, pointed=points)
    try:
        return await after(ctx, session, turn, detail=detail, picture=picture)
    except InputError as error:
        if error.kind != "not_allowed":
            raise
        raise InputError(NO_GO) from None


@told
async def edit(
    ctx: Ctx,
    session: ASession,
    edits: Edits,
    idempotency_key: AKey | None = None,
    detail: Detail = False,
    picture: Shown = False,
) -> Told:
    """Change the plan that stands exactly, without words; what is not named stays as it is."""
    hub, person = caller(ctx)
    need(person, "plan")
    await theirs(ctx, session)
    asked = Asked(by=person.name, key=idempotency_key, may_move=False)
    turn = hub.service.edit(session, *edits, asked=asked)
    return await after(ctx, session, turn, detail=detail, picture=picture)


@told
async def status(
    ctx: Ctx,
    session: ASession,
    wait: Annotated[bool, Field(description="for some seconds, for the end of what runs")] = False,
    detail: Detail = False,
    picture: Shown = False,
) -> Told:
    """How a session stands: its plan, what waits for a person, whether robots drive or arrived."""
    await theirs(ctx, session)
    turn = caller(ctx)[0].service.turn(session)
    if wait and turn is not None:
        return await after(ctx, session, turn, detail=detail, picture=picture)
    return await standing(ctx, session, detail=detail, picture=picture)


@told
async def approve_and_deploy(
    ctx: Ctx,
    session: ASession,
    plan_id: Annotated[str, Field(min_length=1, max_length=100)],
    idempotency_key: AKey,
    answer: Annotated[Answer, Resolve(ask_person)],
) -> Told:
    """Drive the robots to a certified plan. Real ones only after a person said yes, who is asked.

    Robots that still drive after some seconds: status "running", then ask status.
    """
    hub, person = caller(ctx)
    said = answer.data if isinstance(answer, AcceptedElicitation) else None
    if isinstance(said, str):
        return await standing(ctx, session, said)
    if isinstance(answer, CancelledElicitation):
        return await standing(ctx, session, "Nobody answered. ")
    asked = asked_by(person, key_of_yes(idempotency_key))
    if not isinstance(said, Yes) or not said.approve:
        return await after(ctx, session, hub.service.say(session, "no", asked))
    waits = await hub.service.waits(session)
    nonce = "" if waits is None else waits.nonce
    return await after(ctx, session, hub.service.approve(session, plan_id, nonce, asked=asked))


@told
async def stop(ctx: Ctx, session: ASession) -> Told:
    """Hold all robots at once where they are, and end what runs."""
    hub, person = caller(ctx)
    await theirs(ctx, session)
    await hub.service.stop(session, asked_by(person))
    return await standing(ctx, session)


def add_tools(server: MCPServer[Access]) -> None:
    """Offer them."""
    for tool in (open_scene, instruct, edit, stop):
        hints = ToolAnnotations(destructive_hint=False, open_world_hint=False)
        server.add_tool(tool, annotations=hints)
    server.add_tool(status, annotations=ToolAnnotations(read_only_hint=True))
    hints = ToolAnnotations(destructive_hint=True, idempotent_hint=True)
    server.add_tool(approve_and_deploy, annotations=hints)
