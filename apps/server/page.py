"""The page that a server opens: its files as they are in the package, nothing from elsewhere."""

import json
from importlib import resources
from mimetypes import guess_type

from fastapi import APIRouter, Response

from ...tools.errors import InputError

PAGE = resources.files("formup") / "apps/page"
PHOTOS = resources.files("formup") / "evals/photos/images"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Scripts, styles, pictures and requests are the server's own; pictures may be made by the page."""
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
FILES = {entry.name: entry for entry in PAGE.iterdir() if not entry.name.startswith("_")}
EXAMPLES = {e["name"] for e in json.loads(FILES["examples.json"].read_text("utf-8"))}
router = APIRouter(include_in_schema=False)


@router.get("/")
def index() -> Response:
    """The page."""
    return _file("index.html", FILES["index.html"].read_bytes())


@router.get("/page/{name}")
def part(name: str) -> Response:
    """A script, a style sheet or the list of examples."""
    if name not in FILES:
        raise InputError(f"There is no {name[:100]!r} here.", "missing")
    return _file(name, FILES[name].read_bytes())


@router.get("/page/examples/{name}")
def example(name: str) -> Response:
    """A photograph that the page offers to begin with."""
    if name not in EXAMPLES:
        raise InputError(f"There is no {name[:100]!r} here.", "missing")
    return _file(name, (PHOTOS / name).read_bytes())


def _file(name: str, data: bytes) -> Response:
    return Response(data, media_type=guess_type(name)[0], headers=HEADERS)
