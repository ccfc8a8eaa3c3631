"""What all routes of a server share: the service, who asks, and how errors are told."""

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
    "not_allowed": 403,
    "too_large": 413,
    "too_many": 429,
}
"""HTTP statuses by the kind of an error; 422 for any other that a person causes."""


@dataclass
class Hub:
    """What a server works with.

    Attributes:
        running: how many requests of a person are under way.
        streams: how many event streams are open.
        leaving: whether it is about to end; it is not ready for more then.
    """

    service: Service
    settings: ServerSettings
    tokens: Tokens
    metrics: Metrics
    leaving: bool = False
    streams: int = 0
    running: Counter[str] = field(default_factory=Counter[str])


def hub_of(request: Request) -> Hub:
    """The hub of the server that a request came to."""
    return request.app.state.hub


def person_of(request: Request) -> Person:
    """Who a request comes from, as the guard found."""
    return request.state.person


AHub = Annotated[Hub, Depends(hub_of)]
APerson = Annotated[Person, Depends(person_of)]


def need(person: Person, scope: Scope) -> None:
    """Refuse who may not do something.

    Raises:
        InputError: saying so (`not_allowed`).
    """
    if not person.may(scope):
        raise InputError(
            f"The token {person.name!r} has the scope {person.scope}; this needs {scope}.",
            "not_allowed",
        )


def check_owner(session: str, person: Person, by: str | None = None) -> str:
    """The id of a session of theirs; others are as if they were not there.

    Args:
        by: who asked for the turn that is looked at: those who approve see what came of it.

    Raises:
        InputError: it is not theirs (`missing`).
    """
    approved = person.may("approve") and by == person.name
    if owner_of(session) != person.name and not approved:
        raise InputError(f"There is no session {session!r}.", "missing")
    return session


async def check_seen(hub: Hub, session: str, person: Person) -> str:
    """The id of a session of theirs, or for those who approve of one in which something waits.

    Raises:
        InputError: it is neither (`missing`).
    """
    if person.may("approve") and await hub.service.waits(session) is not None:
        return session
    return check_owner(session, person)


def asked_by(person: Person, key: str | None = None) -> Asked:
    """Who asks for a turn, to the service."""
    return Asked(by=person.name, key=key, may_move=person.may("move"))


def error_data(message: str, code: str | None, type: str = "invalid_request_error") -> Any:
    """An error as OpenAI's API has it, which all routes keep to."""
    return {"error": {"message": message, "type": type, "param": None, "code": code}}


def error_response(status: int, message: str, code: str | None = None) -> JSONResponse:
    """An error, as a response."""
    kind = "invalid_request_error" if status < 500 else "server_error"
    return JSONResponse(error_data(message, code, kind), status)


def told(error: FormupError) -> JSONResponse:
    """An error that formup raised on purpose, as a response."""
    by_kind = STATUS.get(error.kind)
    usual = (
        500 if isinstance(error, StorageError) else 422 if isinstance(error, InputError) else 502
    )
    status = by_kind or usual
    if status >= 500:  # names addresses of the store, of models' and robots' hosts
        LOG.error("failed", extra={"facts": {"error": str(error)}})
        return error_response(status, "The server cannot do that now; its log says why.")
    return error_response(status, str(error), error.kind)
