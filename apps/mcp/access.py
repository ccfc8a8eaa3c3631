"""Access control of the MCP server: who calls, what they may reach, which errors they see."""

import asyncio
import base64
import binascii
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from mcp.server.mcpserver import Context
from mcp.server.mcpserver.exceptions import ResourceError, ResourceNotFoundError

from ...agent.conversation import Session
from ...agent.service import Service
from ...tools.errors import FormupError, InputError
from ...tools.perception.image import Picture, load_picture
from ..server.hub import Hub, check_owner, require_scope
from ..server.sessions import checked_picture
from ..server.tokens import Person, Scope

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Access:
    """What the MCP server has access to.

    Attributes:
        folders: the folders whose pictures may be opened by path; none over HTTP.
    """

    hub: Hub
    folders: tuple[Path, ...] = ()


Ctx = Context[Access, Any]


def caller(ctx: Ctx) -> tuple[Hub, Person]:
    """Return the hub and the caller: over HTTP the guard's, otherwise this machine's user."""
    request = ctx.request_context.request
    person = Person() if request is None else request.state.person
    return ctx.request_context.lifespan_context.hub, person


def with_error_messages(work: Callable[P, Awaitable[R]]) -> Callable[P, Awaitable[R]]:
    """Wrap a tool or resource so that clients see the messages of `FormupError` and no others."""

    @wraps(work)
    async def telling(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return await work(*args, **kwargs)
        except FormupError as error:
            kind = ResourceNotFoundError if error.kind == "missing" else ResourceError
            raise kind(str(error)) from None

    return telling


async def own_session(ctx: Ctx, session: str) -> Session:
    """Return a session of the caller; the sessions of others count as missing.

    Raises:
        InputError: the caller has no such session (`missing`).
    """
    hub, person = caller(ctx)
    try:
        return await hub.service.fresh(check_owner(session, person))
    except InputError as error:
        if error.kind != "missing":
            raise
        raise InputError(f"There is no session {session!r}.", "missing") from None


async def authorize(ctx: Ctx, session: str, scope: Scope = "read") -> tuple[Service, Person]:
    """Return the service and the caller, once they are known to have the scope and the session.

    Raises:
        InputError: they lack the scope (`not_allowed`), or have no such session (`missing`).
    """
    hub, person = caller(ctx)
    require_scope(person, scope)
    await own_session(ctx, session)
    return hub.service, person


async def picture_named(ctx: Ctx, image: str) -> Picture:
    """Return the picture that a client names: a data URL, or a file, over HTTP a session's id.

    Raises:
        InputError: there is no such picture, or it may not be used.
    """
    hub, folders = caller(ctx)[0], ctx.request_context.lifespan_context.folders
    if image.startswith("data:"):
        try:
            data = base64.b64decode(image.partition(",")[2], validate=True)
        except binascii.Error:
            raise InputError(
                "The data URL cannot be read; give data:image/jpeg;base64, and the file in base64."
            ) from None
        return await asyncio.to_thread(checked_picture, data, "picture", hub)
    if folders:
        return await asyncio.to_thread(lambda: load_picture(_inside(image, folders)))
    try:
        return (await own_session(ctx, image)).picture
    except InputError as error:
        if error.kind != "missing":
            raise
        raise InputError(
            f"{image[:80]!r} is neither a data URL nor the id of one of your sessions, and files "
            "on the server cannot be opened; send the picture with POST /api/sessions, and give "
            "the id that it returns."
        ) from None


def _inside(image: str, folders: Sequence[Path]) -> Path:
    """Return a path, links resolved, if it lies in one of the folders; else raise InputError."""
    try:
        paths = [((folder / image).resolve(), folder.resolve()) for folder in folders]
        inside = [path for path, folder in paths if path.is_relative_to(folder)]
        if inside:
            return next((path for path in inside if path.exists()), inside[0])
    except (OSError, ValueError, RuntimeError):
        pass  # not a path at all
    there = ", ".join(map(str, folders))
    raise InputError(
        f"{image[:200]!r} is not inside {there}; put the picture there, or have the server "
        "started with its folder."
    )
