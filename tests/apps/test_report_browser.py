"""The report in a browser, on a desk and on a phone: it works, runs nothing else, loads nothing."""

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

import pytest
from formup.apps.cli import app
from PIL import Image
from playwright.sync_api import Browser, Dialog, Page, Request, expect, sync_playwright

chromium = import_module("chromium")
hostile = import_module("hostile")
write_run: Callable[..., Path] = hostile.write_run
TASKS: int = hostile.TASKS
SIZES = {"desk": (1280, 900), "phone": (390, 844)}
pytestmark = pytest.mark.skipif(
    chromium.CHROMIUM is None, reason="there is no chromium to look with"
)


@dataclass
class Seen:
    """What must not happen while a page is open."""

    dialogs: list[str] = field(default_factory=list[str])
    errors: list[str] = field(default_factory=list[str])
    requests: list[str] = field(default_factory=list[str])

    def dialog(self, dialog: Dialog) -> None:
        self.dialogs.append(dialog.message)
        dialog.dismiss()

    def request(self, request: Request) -> None:
        if not request.url.startswith("data:image/jpeg"):
            self.requests.append(request.url)


@pytest.fixture(scope="module")
def browser(pages: Path) -> Iterator[Browser]:
    """Begun after the pages are made: while it is there an event loop runs, as in no other test."""
    assert pages
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium.CHROMIUM, args=chromium.FLAGS)
        yield found
        found.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Reports: alone.html of one run, both.html of two."""
    folder = tmp_path_factory.mktemp("report")
    a = write_run(folder / "a", "agent", passing=4)
    b = write_run(folder / "b", "alone", passing=1)
    for name, more in (("alone", []), ("both", ["--against", str(b)])):
        arguments = ["eval", "report", str(a), *more, "--out", str(folder / f"{name}.html")]
        assert not app(arguments, standalone_mode=False)
    return folder


@pytest.fixture(params=[(s, c) for s in SIZES for c in ("light", "dark")], ids="-".join)
def look(
    request: pytest.FixtureRequest, browser: Browser, pages: Path
) -> Iterator[Callable[[str], Page]]:
    """Opens a report; at the end nothing must have happened that should not."""
    size, scheme = request.param
    width, height = SIZES[size]
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme, has_touch=size == "phone"
    )
    seen, page = Seen(), context.new_page()
    page.on("dialog", seen.dialog)
    page.on("console", lambda message: seen.errors.append(message.text))
    page.on("pageerror", lambda error: seen.errors.append(str(error)))
    page.on("request", seen.request)

    def opened(name: str) -> Page:
        page.goto((pages / name).as_uri())
        return page

    yield opened
    page.wait_for_timeout(100)
    context.close()
    assert seen == Seen(requests=seen.requests)
    assert all(url.startswith("file:") and url.endswith(".html") for url in seen.requests)


def test_it_can_be_read_and_worked_with(look: Callable[[str], Page]) -> None:
    page = look("both.html")
    tables = page.get_by_role("region", name="Matrix of results")
    expect(tables).to_have_count(2)
    expect(tables.first).to_be_visible()
    assert not sideways(page)
    if page.viewport_size == dict(zip(("width", "height"), SIZES["desk"], strict=True)):
        for table in tables.all():
            assert table.evaluate("e => e.scrollWidth <= e.clientWidth")
    tasks = page.locator("article.task")
    expect(tasks).to_have_count(TASKS)
    page.get_by_label("failed only").check()
    expect(page.locator("article.task:visible")).to_have_count(TASKS - 1)
    page.get_by_label("category").select_option("caging")
    expect(page.locator("article.task:visible")).to_have_count(3)
    expect(page.locator("#count")).to_have_text("3 of 6 tasks")
    page.get_by_label("failed only").uncheck()
    page.get_by_label("category").select_option("all")
    expect(page.locator("article.task:visible")).to_have_count(TASKS)
    said = page.locator("details.transcript").first
    expect(said.locator("pre").first).to_be_hidden()
    said.locator("summary").focus()
    page.keyboard.press("Enter")
    expect(said.locator("pre").first).to_be_visible()
    assert not sideways(page)
    drawn = page.locator("svg.over").first.bounding_box()
    assert drawn is not None
    assert drawn["width"] > 200
    assert drawn["height"] > 100


def test_the_picture_is_painted_wherever_it_is_named(look: Callable[[str], Page]) -> None:
    """One image in the file, shown by drawings that name it, hidden cards or not."""
    page = look("alone.html")
    page.get_by_label("category").select_option("caging")
    drawing = page.locator("article.task:visible svg.over").first
    drawing.scroll_into_view_if_needed()
    page.wait_for_timeout(200)
    page.evaluate("document.querySelectorAll('svg.over > :not(use)').forEach(e => e.remove())")
    box = drawing.bounding_box()
    assert box is not None
    png = page.screenshot(clip={"x": box["x"], "y": box["y"], "width": 60, "height": 60})
    assert grey(png) == pytest.approx(90, abs=4)


def grey(png: bytes) -> float:
    """The middle pixel's red, where the picture is grey."""
    image = Image.open(io.BytesIO(png)).convert("RGB")
    return float(image.getchannel("R").resize((1, 1), Image.Resampling.BOX).tobytes()[0])


def test_it_reads_without_scripts(browser: Browser, pages: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto((pages / "both.html").as_uri())
    expect(page.locator("table").first).to_be_visible()
    expect(page.locator("#filter")).to_be_hidden()
    expect(page.locator("article.task:visible")).to_have_count(TASKS)
    context.close()


def sideways(page: Page) -> bool:
    """Whether the page itself scrolls to the side."""
    return page.evaluate("document.documentElement.scrollWidth > innerWidth")
