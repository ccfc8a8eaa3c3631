"""What all routes of a server share: the service, who asks, and error responses."""

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from fastapi import Depends, Request
from fastapi.responses import JSONResponse

from ...agent.service import Service
from ...agent.store.protocol import owner_of
from ...agent.turns import Asked
from ...tools.errors import FormupError, InputError, Kind, StorageError
from .metrics import Metrics
from .settings import ServerSettings
from .tokens import Person, Scope, Tokens

LOG = logging.getLogger("formup.server")
STATUS: Mapping[Kind | None, int] = {
    "missing": 404,
    "busy": 409,
    "gone_on": 409,
    "key": 409,
    "repeated": 409,
    "approval": 409,
    "asked": 409,
    "not_allowed": 403,
    "too_large": 413,
    "too_many": 429,
}
"""HTTP status by the kind of an error; any other that a person causes is 422."""


@dataclass
class Hub:
    """The shared state of a server.

    Attributes:
        running: number of requests under way, by the name of the person.
        streams: number of open event streams.
        leaving: whether the server is about to end, and so not ready for more.
    """

    service: Service
    settings: ServerSettings
    tokens: Tokens
    metrics: Metrics
    leaving: bool = False
    streams: int = 0
    running: Counter[str] = field(default_factory=Counter[str])


def hub_of(request: Request) -> Hub:
    """Return the hub of the server that a request came to."""
    return request.app.state.hub


def person_of(request: Request) -> Person:
    """Return who a request comes from, as the guard found."""
    return request.state.person


AHub = Annotated[Hub, Depends(hub_of)]
APerson = Annotated[Person, Depends(person_of)]


def require_scope(person: Person, scope: Scope) -> None:
    """Refuse a person who does not have a scope.

    Raises:
        InputError: they do not have it (`not_allowed`).
    """
    if not person.may(scope):
        raise InputError(
            f"The token {person.name!r} has the scope {person.scope}; this needs {scope}.",
            "not_allowed",
        )


def check_owner(session: str, person: Person, by: str | None = None) -> str:
    """Return the session's id if it is the person's own; the sessions of others count as missing.

    Args:
        by: who asked for the turn in question; a person who may approve also sees turns that
            they asked for in the sessions of others.

    Raises:
        InputError: the session is not theirs (`missing`).
    """
    approved = person.may("approve") and by == person.name
    if owner_of(session) != person.name and not approved:
        raise InputError(f"There is no session {session!r}.", "missing")
    return session


async def check_seen(hub: Hub, session: str, person: Person) -> str:
    """Return the session's id if it is theirs, or if they may approve what waits in it.

    Raises:
        InputError: it is neither (`missing`).
    """
    if person.may("approve") and await hub.service.waits(session) is not None:
        return session
    return check_owner(session, person)


def asked_by(person: Person, key: str | None = None) -> Asked:
    """Return who asks for a turn, in the service's terms."""
    return Asked(by=person.name, key=key, may_move=person.may("move"))


def error_data(message: str, code: str | None, type: str = "invalid_request_error") -> Any:
    """Return an error in the format of OpenAI's API, which all routes use."""
    return {"error": {"message": message, "type": type, "param": None, "code": code}}


def error_response(status: int, message: str, code: str | None = None) -> JSONResponse:
    """Return an error as a response."""
    kind = "invalid_request_error" if status < 500 else "server_error"
    return JSONResponse(error_data(message, code, kind), status)


def formup_error_response(error: FormupError) -> JSONResponse:
    """Return the response to a `FormupError`; from status 500 on, it only points to the log."""
    by_kind = STATUS.get(error.kind)
    usual = (
        500 if isinstance(error, StorageError) else 422 if isinstance(error, InputError) else 502
    )
    status = by_kind or usual
    if status >= 500:  # may name addresses of the store, models and robots
        LOG.error("failed", extra={"facts": {"error": str(error)}})
        return error_response(status, "The server cannot do that now; its log says why.")
    return error_response(status, str(error), error.kind)
