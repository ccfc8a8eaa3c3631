"""The web page of a server: its files as they are in the package, nothing from other sites."""

import json
from importlib import resources
from mimetypes import guess_type
from secrets import compare_digest
from urllib.parse import quote

from fastapi import APIRouter, Response

from ...tools.errors import InputError
from .hub import AHub, APerson, Hub

PAGE = resources.files("formup") / "apps/page"
PHOTOS = resources.files("formup") / "evals/photos/images"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Allows only the server's own scripts, styles, pictures and requests, and the page's own blobs."""
POLICY_NAME = "Content-Security-Policy"
ALONE = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; " + (
    "style-src 'unsafe-inline'; img-src data:"
)
"""The policy of a report, sandboxed so that this server is another site to it."""
HEADERS = {
    POLICY_NAME: POLICY,
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


@router.get("/page/examples/{name}")
def example(name: str) -> Response:
    """A photograph that the page offers to begin with."""
    if name not in EXAMPLES:
        raise InputError(f"There is no {name[:100]!r} here.", "missing")
    return _file(name, (PHOTOS / name).read_bytes())


@router.get("/api/reports")
def reports(hub: AHub, person: APerson) -> list[dict[str, str]]:
    """The reports there are, with addresses that want no token."""
    marked = ((name, hub.tokens.mark(person.name, f"report {name}")) for name in _reports(hub))
    owner = person.name or "all"
    return [
        {"name": n, "address": f"/page/reports/{owner}/{mark}/{quote(n)}"} for n, mark in marked
    ]


@router.get("/page/reports/{owner}/{mark}/{name}")
def report(owner: str, mark: str, name: str, hub: AHub) -> Response:
    """A report, which may run its own scripts and reaches nothing of this server."""
    known = hub.tokens.mark("" if owner == "all" else owner, f"report {name}")
    if name not in _reports(hub) or not compare_digest(mark.encode(), known.encode()):
        raise InputError(f"There is no report {name[:100]!r}.", "missing")
    assert hub.settings.reports is not None
    data = (hub.settings.reports / name).read_bytes()
    return Response(data, media_type="text/html", headers=HEADERS | {POLICY_NAME: ALONE})


@router.get("/page/{name}")
def part(name: str) -> Response:
    """A script, a style sheet or the list of examples."""
    if name not in FILES:
        raise InputError(f"There is no {name[:100]!r} here.", "missing")
    return _file(name, FILES[name].read_bytes())


def _reports(hub: Hub) -> list[str]:
    folder = hub.settings.reports
    return [] if folder is None else sorted(path.name for path in folder.glob("*.html"))


def _file(name: str, data: bytes) -> Response:
    return Response(data, media_type=guess_type(name)[0], headers=HEADERS)
