"""The MCP server, and its HTTP endpoint behind the same guard as all other routes."""

from collections.abc import AsyncGenerator, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from mcp.server import MCPServer
from mcp.server.auth.middleware.auth_context import AuthContextMiddleware
from mcp.server.auth.middleware.bearer_auth import AuthenticatedUser
from mcp.server.auth.provider import AccessToken
from mcp.server.mcpserver import Context
from mcp.server.mcpserver.exceptions import ToolError, UnexpectedToolError
from mcp.server.transport_security import TransportSecuritySettings
from mcp_types import INVALID_REQUEST, CallToolResult, InputRequiredResult
from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.routing import Route
from starlette.types import Message, Receive, Scope, Send

from ...tools.tool import violations
from ..server.hub import Hub
from ..server.tokens import Person
from .access import Access
from .resources import add_resources
from .tools import add_tools

SESSION = "mcp-session-id"
"""The header that names an MCP session of the older era, which is one process's."""
INSTRUCTIONS = (
    "Places a team of robots in a picture as a person says, proves the placement, and drives them "
    "there. Call open_scene, then instruct with the person's own words, which it interprets: do "
    "not compute positions. Show its messages and questions to the person. Only "
    "approve_and_deploy moves robots; stop holds them at once."
)
GONE = (
    "This process has no such MCP session: it ended, the server was started anew, or a balancer "
    "sent the request to another process, and has to send all of a client's to the same one. "
    "Connect again; the sessions of open_scene are whole, and their ids still hold."
)


class _Server(MCPServer[Access]):
    """A server that says which arguments a call lacks, has wrong, or that no tool knows."""

    async def call_tool(
        self, name: str, arguments: dict[str, Any], context: Context[Access, Any] | None = None
    ) -> CallToolResult | InputRequiredResult:
        await self._check_known(name, arguments)
        try:
            return await super().call_tool(name, arguments, context)
        except ToolError as error:
            wrong = error.__cause__
            if isinstance(error, UnexpectedToolError) or not isinstance(wrong, ValidationError):
                raise
            told = f"{name} cannot be called with these arguments: {violations(wrong)}"
            raise ToolError(told) from wrong

    async def _check_known(self, name: str, arguments: dict[str, Any]) -> None:
        """Refuse arguments that a tool does not have; the library would drop them silently."""
        offered = {tool.name: tool.input_schema for tool in await self.list_tools()}
        known = list(offered.get(name, {}).get("properties", arguments))
        unknown = [f"{argument[:100]!r}" for argument in arguments if argument not in known]
        if unknown:
            raise ToolError(
                f"{name} does not know {', '.join(unknown)}; nothing was done. Its arguments are "
                f"{', '.join(known)}: leave out the others, or call them so."
            )


def make_server(hub: Hub, folders: Sequence[Path] = ()) -> MCPServer[Access]:
    """Return an MCP server with the tools and resources.

    Args:
        folders: the folders whose pictures may be opened by path.
    """
    access = Access(hub, tuple(folders))

    @asynccontextmanager
    async def lifespan(server: MCPServer[Access]) -> AsyncGenerator[Access]:
        yield access

    server = _Server(
        "formup",
        version=version("formup"),
        instructions=INSTRUCTIONS,
        lifespan=lifespan,
        log_level="WARNING",
    )
    add_tools(server)
    add_resources(server)
    return server


class Endpoint:
    """An ASGI application for one path, behind the guard, which has identified the caller.

    Attributes:
        server: the MCP server that it serves.
    """

    def __init__(self, hub: Hub) -> None:
        self.server = make_server(hub)
        checked = TransportSecuritySettings(enable_dns_rebinding_protection=False)  # by the guard
        self.server.streamable_http_app(
            max_request_body_size=hub.settings.upload_bytes, transport_security=checked
        )
        self._manager = self.server.session_manager
        self._app = AuthContextMiddleware(self._manager.handle_request)

    def running(self) -> AbstractAsyncContextManager[None]:
        """Return the context in which it can be called; it can be entered only once."""
        return self._manager.run()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; MCP sessions and questions belong to the token they began with."""
        person: Person = scope["state"]["person"]
        token = AccessToken(token="", client_id=person.name, scopes=[person.scope])
        known = {**scope, "user": AuthenticatedUser(token)}
        gone = False

        async def explained(message: Message) -> None:
            nonlocal gone
            gone = gone or message.get("status") == 404
            if not gone:
                await send(message)

        in_session = SESSION in Headers(scope=scope)
        await self._app(known, receive, explained if in_session else send)
        if gone:
            error = {"code": INVALID_REQUEST, "message": GONE}
            told = JSONResponse({"jsonrpc": "2.0", "id": None, "error": error}, 404)
            await told(scope, receive, send)


def mount(app: Starlette, hub: Hub) -> None:
    """Serve MCP at /mcp of an application for as long as it runs."""
    endpoint, before = Endpoint(hub), app.router.lifespan_context

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncGenerator[Any]:
        async with endpoint.running(), before(app) as state:
            yield state

    app.router.lifespan_context = lifespan
    app.router.routes.append(Route("/mcp", endpoint))
