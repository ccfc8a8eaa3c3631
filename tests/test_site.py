"""The documentation's site: it builds without a warning, its links lead somewhere, and it can be
read and searched without a network, in light and dark, on a desk and on a phone."""

import fcntl
import functools
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import formup
import pytest
from formup.tools.builtin import TOOLS
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

for module in ("sphinx", "myst_parser", "furo"):
    pytest.importorskip(module, reason="formup[docs] is not installed")
Axe: Any = import_module("axe_playwright_python.sync_playwright").Axe
chromium = import_module("chromium")
ROOT = Path(__file__).parent.parent
PAGES = ("docs/README", "docs/measurements", "docs/reference/python/tools", "search")
"""The index, a long page, one of the reference, and the search."""
in_browser = pytest.mark.skipif(
    chromium.CHROMIUM is None, reason="there is no chromium to look with"
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """The site, built by whichever worker comes first."""
    shared = tmp_path_factory.getbasetemp()
    shared = (shared if worker_id == "master" else shared.parent) / "site"
    shared.mkdir(exist_ok=True)
    out = shared / "html"
    with (shared / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (shared / "built").exists():
            command = [sys.executable, "-m", "sphinx", "-q", "-E", "-W", "--keep-going"]
            command += ["-d", str(shared / "doctrees"), "-c", "docs/site", ".", str(out)]
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr
            (shared / "built").touch()
    return out


class Links(HTMLParser):
    """What a page can be entered at, leads to, and loads."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.anchors, self.targets, self.loaded = set[str](), list[str](), list[str]()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what an element has of these."""
        found = {name: value for name, value in attrs if value is not None}
        self.anchors |= {found[name] for name in ("id", "name") if name in found}
        targets = [found[name] for name in ("href", "src") if name in found]
        self.targets += targets
        if tag != "a":
            self.loaded += targets


@pytest.fixture(scope="module")
def links(site: Path) -> dict[Path, Links]:
    return {page: Links(page) for page in site.rglob("*.html")}


def test_every_link_leads_somewhere(links: dict[Path, Links]) -> None:
    broken: list[str] = []
    followed = 0
    for page, found in links.items():
        for target in found.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            followed += 1
            file = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            anchors = links[file].anchors if file in links else {""}
            if not file.is_file() or unquote(parts.fragment) not in anchors | {""}:
                broken.append(f"{page.name}: {target}")
    assert broken == []
    assert followed > 1000


def test_nothing_is_loaded_from_elsewhere(site: Path, links: dict[Path, Links]) -> None:
    loaded = [target for found in links.values() for target in found.loaded]
    assert loaded
    assert [target for target in loaded if urlsplit(target).netloc] == []
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\(['\"]?(https?:)?//|@import", sheet.read_text("utf-8")), sheet


def test_the_reference_has_all_there_is(links: dict[Path, Links], site: Path) -> None:
    from formup.apps.cli import app
    from formup.apps.server.app import PARTS
    from typer.main import get_command

    reference = site / "docs/reference"
    python = set[str]().union(*(links[p].anchors for p in reference.glob("python/*.html")))
    assert {f"formup.{name}" for name in formup.__all__} <= python
    tools = (reference / "tools.html").read_text("utf-8")
    assert [tool.name for tool in TOOLS if f"<h2>{tool.name}<" not in tools] == []
    http = (reference / "http.html").read_text("utf-8")
    paths = {route.path_format for part in PARTS for route in part.router.routes if shown(route)}
    assert {path for path in paths if f" {path}<" not in http} == set()
    assert "/api/sessions" in paths
    whole: Any = get_command(app)
    for name, command in whole.commands.items():
        for word in getattr(command, "commands", ("",)):
            page = reference / f"commands/{name if word else 'formup'}.html"
            assert f"<h2>formup {name} {word}".rstrip() + "<" in page.read_text("utf-8")


def shown(route: Any) -> bool:
    return route.include_in_schema


def test_pages_are_plain_markdown() -> None:
    """They are read where they lie too, where a generator's words would be noise."""
    pages = sorted((ROOT / "docs").glob("*.md"))
    assert pages
    for page in pages:
        text = page.read_text("utf-8")
        assert not re.search(r"\A---\n|^\s*(```|~~~|:::+)\s*\{", text, re.MULTILINE), page
        prose = re.sub(r"^```.*?^```|`[^`]*`", "", text, flags=re.MULTILINE | re.DOTALL)
        assert not re.search(r"\{[\w:-]+\}", prose), page


@pytest.fixture(scope="module")
def browser(site: Path) -> Iterator[Browser]:
    """Begun after the site is built: while it is there an event loop runs."""
    assert site.is_dir()
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium.CHROMIUM, args=chromium.FLAGS)
        yield found
        found.close()


Opened = Callable[..., Page]


@pytest.fixture
def opened(browser: Browser, site: Path) -> Iterator[Opened]:
    """Opens windows; at the end none may have asked elsewhere, or met an error of its script."""
    wrong: list[str] = []
    contexts: list[BrowserContext] = []

    def window(**options: Any) -> Page:
        contexts.append(browser.new_context(**options))
        page = contexts[-1].new_page()
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: wrong.extend(elsewhere(request.url)))
        return page

    yield window
    for context in contexts:
        context.close()
    assert wrong == []


def elsewhere(url: str) -> list[str]:
    """The address, if it is on another machine."""
    parts = urlsplit(url)
    return [] if parts.scheme in ("file", "data") or parts.hostname == "127.0.0.1" else [url]


@in_browser
@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 390)])
def test_axe_finds_nothing(opened: Opened, site: Path, scheme: str, width: int) -> None:
    page = opened(color_scheme=scheme, viewport={"width": width, "height": 900})
    for name in PAGES:
        page.goto((site / f"{name}.html").as_uri())
        found: list[Any] = Axe().run(page).response["violations"]
        assert [(name, v["id"], v["nodes"][0]["html"][:200]) for v in found] == []


@in_browser
def test_no_page_scrolls_sideways_on_a_phone(
    opened: Opened, site: Path, links: dict[Path, Links]
) -> None:
    page = opened(viewport={"width": 390, "height": 844})
    wide: list[str] = []
    for file in links:
        if file.name == "index.html":  # only leads on to another
            continue
        page.goto(file.as_uri())
        if page.evaluate("document.documentElement.scrollWidth > innerWidth"):
            wide.append(file.name)
    assert wide == []


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder, and says nothing."""

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


@pytest.fixture(params=["file", "http"])
def address(request: pytest.FixtureRequest, site: Path) -> Iterator[str]:
    if request.param == "file":
        yield site.as_uri()
        return
    handler = functools.partial(Quiet, directory=str(site))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,)).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


@in_browser
def test_the_search_finds_a_word(opened: Opened, address: str) -> None:
    page = opened()
    page.goto(f"{address}/index.html")
    expect(page).to_have_url(f"{address}/docs/README.html")
    page.get_by_placeholder("Search").fill("rosbridge")
    page.keyboard.press("Enter")
    found = page.locator("#search-results").get_by_role("link", name="Robots that run ROS 2")
    found.first.click()
    expect(page.locator("h1")).to_contain_text("Robots that run ROS 2")
