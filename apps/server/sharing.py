"""The routes that share a session: an export of all it holds, and codes that only show it."""

import asyncio
import io
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from fastapi import APIRouter, Response

from ...agent.export import export_json, export_page
from ...agent.store.protocol import StoredSession
from .forms import Shared
from .hub import AHub, APerson, check_owner, require_scope
from .sessions import ERRORS

router = APIRouter(prefix="/api/sessions/{session}", tags=["sharing"], responses=ERRORS)


@router.get(
    "/export", response_class=Response, responses={200: {"content": {"application/zip": {}}}}
)
async def export(session: str, hub: AHub, person: APerson) -> Response:
    """Export the session as a ZIP file of Markdown with pictures, and JSON."""
    await hub.service.fresh(check_owner(session, person))
    data = await asyncio.to_thread(_zipped, hub.service.store.open(session))
    named = {"Content-Disposition": f'attachment; filename="formup-{session}.zip"'}
    return Response(data, media_type="application/zip", headers=named)


def _zipped(session: StoredSession) -> bytes:
    file = io.BytesIO()
    with TemporaryDirectory() as name, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        folder = Path(name)
        export_page(session, folder)
        export_json(session, folder)
        for path in sorted(p for p in folder.rglob("*") if p.is_file()):
            made.write(path, path.relative_to(folder).as_posix())
    return file.getvalue()


@router.post("/shares", status_code=201)
async def share(session: str, hub: AHub, person: APerson) -> Shared:
    """Create a code that gives anybody read-only access to the session.

    It is sent as `Authorization: Share CODE`, and valid as long as the token that created it.
    """
    require_scope(person, "plan")
    await hub.service.fresh(check_owner(session, person))
    return Shared(code=hub.tokens.share(session))
