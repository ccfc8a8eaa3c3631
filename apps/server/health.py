"""Health checks of a server, live and ready, and its metrics for Prometheus."""

import asyncio

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse

from ...tools.errors import StorageError
from .hub import AHub, APerson

router = APIRouter(tags=["operations"])


@router.get("/health/live", summary="Check that the process answers")
async def live() -> dict[str, str]:
    """Check that the process answers."""
    return {"status": "ok"}


@router.get("/health/ready", responses={503: {"description": "The server is not ready"}})
async def ready(hub: AHub) -> JSONResponse:
    """Check that the server takes requests: its store works and it is not shutting down."""
    if hub.leaving:
        return JSONResponse({"status": "leaving"}, 503)
    try:
        await asyncio.to_thread(hub.service.store.holder, "ready")
    except StorageError as error:
        return JSONResponse({"status": "no store", "message": str(error)}, 503)
    return JSONResponse({"status": "ok"})


@router.get("/metrics", response_class=Response)
async def metrics(hub: AHub, person: APerson) -> Response:
    """Get metrics in the text format of Prometheus."""
    from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

    return Response(generate_latest(hub.metrics.registry), media_type=CONTENT_TYPE_LATEST)
