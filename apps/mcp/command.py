"""`formup mcp`: stdio by default, where nothing but the protocol may be written to stdout."""

import asyncio
import os
import signal
from collections.abc import Coroutine
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...tools.errors import InputError
from .. import arguments, serve
from .. import options as o
from ..main import INTERRUPTED

if TYPE_CHECKING:
    from ..server.hub import Hub

NEEDED = "formup mcp needs an extra that is not installed: pip install 'formup[mcp]'."
LIBRARIES = ("mcp", "mcp_types", "fastapi", "uvicorn", "prometheus_client")
Http = Annotated[
    bool,
    typer.Option("--http", help="Serve over HTTP instead, at /mcp, exactly as formup serve does."),
]
Pictures = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="DIR",
        help="Folder whose pictures may be opened; default: the current folder; repeatable.",
    ),
]


def mcp(
    pictures: Pictures = None,
    http: Http = False,
    host: serve.Host = None,
    port: serve.Port = None,
    tokens_file: serve.TokensFile = None,
    store: o.StoreUrl = None,
    model: serve.Models = None,
    base_url: o.BaseUrl = None,
    planner: o.PlannerName = None,
    prompt: o.PromptName = None,
    prompts: o.PromptsFolder = None,
    limit: o.LimitList = None,
    policy: o.PolicyList = None,
    fleet: serve.NewFleet = None,
    detector: o.DetectorName = None,
    segmenter: o.SegmenterName = None,
    threshold: o.Threshold = None,
) -> None:
    """Serve the team to Model Context Protocol clients, over stdio."""
    try:
        from ..server.hub import Hub
        from ..server.metrics import Metrics
        from ..server.settings import ServerSettings
        from ..server.tokens import Tokens
        from .server import make_server
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] not in LIBRARIES:
            raise
        raise InputError(NEEDED) from None
    rest = (base_url, planner, prompt, prompts, limit, policy)
    if http:
        named = (host, port, tokens_file, store, model)
        return serve.serve(*named, *rest, fleet, detector, segmenter, threshold)
    settings = ServerSettings.of(
        store=store,
        fleet=fleet,
        detector=detector,
        segmenter=segmenter,
        threshold=arguments.share("--threshold", threshold),
        model=model and ",".join(model),
    )
    folders = [folder.resolve() for folder in pictures or [Path()]]
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"--pictures {folder} is not a folder; give one that exists.")
    with serve.service_of(settings, planner, base_url, prompt, prompts, limit, policy) as service:
        hub = Hub(service, settings, Tokens(None), Metrics())
        raise typer.Exit(asyncio.run(_serve(hub, make_server(hub, folders).run_stdio_async())))


async def _serve(hub: "Hub", work: Coroutine[Any, Any, None]) -> int:
    """Serve until stdin closes or a signal comes, then hold robots; return the exit code."""
    loop, serving = asyncio.get_running_loop(), asyncio.ensure_future(work)
    ended: asyncio.Future[int] = loop.create_future()

    def end(code: int) -> None:
        if not ended.done():
            ended.set_result(code)

    serving.add_done_callback(lambda _: end(0))
    with suppress(NotImplementedError):  # on Windows
        loop.add_signal_handler(signal.SIGTERM, end, 0)
        loop.add_signal_handler(signal.SIGINT, end, INTERRUPTED)
    code = await ended
    await hub.service.close()
    if not serving.done():
        os._exit(code)  # nothing wakes the thread that waits for stdin
    await serving
    return code
