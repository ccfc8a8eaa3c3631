"""Health checks of a server, live and ready, and its metrics for Prometheus."""

import asyncio

from fastapi import APIRouter, Response
from fastapi.responses import JSONResponse

from ...tools.errors import StorageError
from .hub import AHub, APerson

router = APIRouter(tags=["operations"])


@router.get("/health/live", summary="Whether the process answers")
async def live() -> dict[str, str]:
    """Whether the process answers."""
    return {"status": "ok"}


@router.get("/health/ready", responses={503: {"description": "It is not ready"}})
async def ready(hub: AHub) -> JSONResponse:
    """Whether it takes requests: the store can be used, and it is not about to end."""
    if hub.leaving:
        return JSONResponse({"status": "leaving"}, 503)
    try:
        await asyncio.to_thread(hub.service.store.holder, "ready")
    except StorageError as error:
        return JSONResponse({"status": "no store", "message": str(error)}, 503)
    return JSONResponse({"status": "ok"})


@router.get("/metrics", response_class=Response)
async def metrics(hub: AHub, person: APerson) -> Response:
    """Figures in the text format of Prometheus."""
    from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

    return Response(generate_latest(hub.metrics.registry), media_type=CONTENT_TYPE_LATEST)
