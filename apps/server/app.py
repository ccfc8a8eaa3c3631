"""The application of a server: its routes, guard, error handlers and lifespan."""

from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager
from importlib.metadata import version
from importlib.util import find_spec

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

from ...agent.service import Service
from ...tools.errors import FormupError
from . import health, openai_chat, openai_responses, page, scenes, sessions, sharing, streams, turns
from .guard import Guard
from .hub import Hub, error_response, formup_error_response
from .metrics import Metrics
from .settings import ServerSettings
from .tokens import Tokens

PARTS = (
    *(page, health, sessions, scenes, sharing, turns, streams),
    *(openai_chat, openai_responses),
)


def make_app(service: Service, settings: ServerSettings, tokens: Tokens) -> FastAPI:
    """Return the application of a server.

    Args:
        service: closed when the application ends.
    """
    hub = Hub(service, settings, tokens, Metrics())
    service.ended = hub.metrics.turn_ended

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncGenerator[None]:
        yield
        await service.close()

    app = FastAPI(
        title="formup",
        version=version("formup"),
        summary="Talk to a team of robots over HTTP.",
        lifespan=lifespan,
        docs_url=None,  # its page fetches scripts from other sites
        redoc_url=None,
    )
    app.state.hub = hub
    for part in PARTS:
        app.include_router(part.router)
    if find_spec("mcp") is not None:
        from ..mcp.server import mount

        mount(app, hub)
    app.add_middleware(Guard, hub=hub)
    app.add_exception_handler(FormupError, _formup_error)
    app.add_exception_handler(RequestValidationError, _invalid_request)
    app.add_exception_handler(HTTPException, _http_error)
    return app


async def _formup_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, FormupError)
    return formup_error_response(error)


async def _invalid_request(request: Request, error: Exception) -> Response:
    """Report all violations at once, without the values, which may be long."""
    assert isinstance(error, RequestValidationError)
    parts = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
    return error_response(422, f"{'; '.join(parts)}.", "invalid")


async def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    response = error_response(error.status_code, str(error.detail))
    response.headers.update(error.headers or {})
    return response
