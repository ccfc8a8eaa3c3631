"""A real browser on a real server: what must not happen while a page is open is looked for."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, Request, expect, sync_playwright

chromium = import_module("chromium")
LONG = 20_000
"""Longest, ms, that a turn may take on a machine that is busy."""


@dataclass
class Visit:
    """A page that is open, and what it asked for and complained of."""

    page: Page
    url: str
    requests: list[str] = field(default_factory=list[str])
    errors: list[str] = field(default_factory=list[str])

    def begin(self, example: int = 0) -> None:
        """Begin with one of the examples."""
        self.page.goto(self.url)
        self.page.locator("#examples button").nth(example).click()
        expect(self.page.locator("#scene image")).to_be_attached(timeout=LONG)

    def say(self, words: str) -> None:
        """Send words and wait for the turn's end."""
        before = self.page.locator("#log > li[data-status]").count()
        self.page.fill("#words", words)
        self.page.click("#send")
        expect(self.page.locator("#log > li[data-status]")).to_have_count(before + 1, timeout=LONG)
        self.rest()

    def rest(self) -> None:
        """Wait until nothing is under way."""
        expect(self.page.locator("#talk[aria-busy]")).to_have_count(0, timeout=LONG)

    def robot(self, number: int) -> Locator:
        """The mark of a robot's place."""
        return self.page.locator(f'.robot[data-number="{number}"]')

    def drag(self, number: int, dx: float, dy: float, steps: int = 6) -> None:
        """Drag a robot by so many pixels of the screen."""
        box = self.robot(number).locator(".disc").bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        mouse = self.page.mouse
        mouse.move(x, y)
        mouse.down()
        for k in range(1, steps + 1):
            mouse.move(x + dx * k / steps, y + dy * k / steps)
            self.page.wait_for_timeout(20)
        mouse.up()

    def status(self) -> str:
        """What the last turn came to."""
        return self.page.locator("#log > li[data-status]").last.get_attribute("data-status") or ""

    @property
    def session(self) -> str:
        """The path of the session's routes."""
        return f"/api/sessions/{self.page.url.rpartition('#')[2]}"


Visits = Callable[..., Visit]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if chromium.CHROMIUM is None:
        pytest.skip("there is no chromium to look with")
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium.CHROMIUM, args=chromium.FLAGS)
        yield found
        found.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Visits]:
    """Opens pages; at the end none may have asked elsewhere, or met an error of its script."""
    visits: list[Visit] = []

    def opened(url: str, **options: Any) -> Visit:
        options.setdefault("viewport", {"width": 1440, "height": 900})
        context = browser.new_context(**options)
        made = Visit(context.new_page(), url)

        def asked(request: Request) -> None:
            if not request.url.startswith((f"{url}/", "blob:")):
                made.requests.append(request.url)

        made.page.on("request", asked)
        made.page.on("pageerror", lambda error: made.errors.append(str(error)))
        visits.append(made)
        return made

    yield opened
    for one in visits:
        one.page.context.close()
    assert [one.requests for one in visits] == [[]] * len(visits)
    assert [one.errors for one in visits] == [[]] * len(visits)
