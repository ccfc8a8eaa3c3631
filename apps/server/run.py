"""The run of a server until it must end: robots are held first, then turns and streams end."""

import json
import logging
import sys
import time
from typing import Any

import uvicorn

from ...agent.service import Service
from ...tools.errors import InputError
from ..terminal import say
from .app import make_app
from .hub import Hub
from .settings import ServerSettings
from .tokens import Tokens

BACKLOG = 512
"""Most connections open at a time, besides event streams."""


class Server(uvicorn.Server):
    """A server that, at its end, holds robots before it waits for anything."""

    def __init__(self, config: uvicorn.Config, hub: Hub) -> None:
        super().__init__(config)
        self._hub = hub

    async def startup(self, sockets: Any = None) -> None:
        """Start listening, and print the address."""
        await super().startup(sockets)
        if self.should_exit:
            return
        host, port = self.servers[0].sockets[0].getsockname()[:2]
        shown = f"[{host}]" if ":" in host else host
        say(f"formup: serving on http://{shown}:{port}; Ctrl-C ends it.", error=True)

    async def shutdown(self, sockets: Any = None) -> None:
        """Hold robots, end turns and streams, then let requests finish."""
        self._hub.leaving = True
        await self._hub.service.leave()
        await super().shutdown(sockets)


def run(service: Service, settings: ServerSettings) -> int:
    """Serve until SIGTERM or Ctrl-C, and return the exit code.

    Raises:
        InputError: the address cannot be listened on.
    """
    log()
    app = make_app(service, settings, Tokens(settings.tokens_file))
    config = uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        ws="none",
        lifespan="on",
        log_config=None,
        server_header=False,
        timeout_keep_alive=65,
        timeout_graceful_shutdown=round(settings.shutdown_seconds),
        limit_concurrency=settings.streams + BACKLOG,
    )
    server = Server(config, app.state.hub)
    try:
        server.run()
    except SystemExit:  # uvicorn exits if it cannot listen; its log says why
        where = f"{settings.host}:{settings.port}"
        raise InputError(f"Cannot listen on {where}; give another --port or --host.") from None
    return 0 if server.started else 4


class JsonLines(logging.Formatter):
    """Formats log records as JSON, one per line, without the query or headers of requests."""

    def format(self, record: logging.LogRecord) -> str:
        """Return one line."""
        made = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        facts: dict[str, Any] = {"time": f"{made}Z", "level": record.levelname.lower()}
        if record.name == "uvicorn.access" and isinstance(record.args, tuple):
            _, method, path, _, status = record.args
            path = str(path).partition("?")[0]
            facts |= {"event": "request", "method": method, "path": path, "status": status}
        else:
            facts |= {"event": record.getMessage(), **getattr(record, "facts", {})}
        if record.exc_info:
            facts["error"] = self.formatException(record.exc_info)
        return json.dumps(facts)


def log() -> None:
    """Set up logging to stderr as JSON lines."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    logging.basicConfig(level=logging.WARNING, handlers=[handler])  # before any library does it
    for name in ("uvicorn", "formup"):
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate = [handler], False
        logger.setLevel(logging.INFO)
