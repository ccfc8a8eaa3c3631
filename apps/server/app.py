"""The application of a server: routes, who may use them, and how it begins and ends."""

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import asynccontextmanager

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from ... import __version__
from ...agent.service import Service
from ...tools.errors import FormupError
from . import health, sessions, streams, turns
from .guard import Guard
from .hub import Hub, error_response, told
from .settings import ServerSettings
from .tokens import Tokens


def make_app(service: Service, settings: ServerSettings, tokens: Tokens) -> FastAPI:
    """The application of a server.

    Args:
        service: which it closes at its end.
    """
    hub = Hub(service, settings, tokens)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncGenerator[None]:
        yield
        hub.leaving = True
        await service.close()

    app = FastAPI(
        title="formup",
        version=__version__,
        summary="Talk to a team of robots over HTTP.",
        lifespan=lifespan,
        docs_url=None,  # its page fetches scripts from elsewhere
        redoc_url=None,
    )
    app.state.hub = hub
    for part in (health, sessions, turns, streams):
        app.include_router(part.router)
    app.add_middleware(Guard, hub=hub)
    app.add_exception_handler(FormupError, _told)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http)
    return app


async def _told(request: Request, error: Exception) -> Response:
    assert isinstance(error, FormupError)
    return told(error)


async def _invalid(request: Request, error: Exception) -> Response:
    """All violations at once; values are left out, for they may be long."""
    assert isinstance(error, RequestValidationError)
    parts = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
    return error_response(422, f"{'; '.join(parts)}.", "invalid")


async def _http(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    response = error_response(error.status_code, str(error.detail), None)
    response.headers.update(error.headers or {})
    return response
