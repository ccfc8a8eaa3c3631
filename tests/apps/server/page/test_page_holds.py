"""What a page has to bear: a server that dies, random gestures, narrow screens, assistive tools."""

import os
import random
import signal
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import expect

sys.path.insert(0, str(Path(__file__).parents[1]))
start = import_module("test_killed").start
Axe: Any = import_module("axe_playwright_python.sync_playwright").Axe
LONG = 20_000
WIDTHS = (390, 768, 1440)
FUZZED = 60
KEYS = ("v", "p", "b", "l", "g", "Escape", "Enter", "Tab", "ArrowUp", "Control+z")


def test_a_server_that_is_killed_while_robots_drive(
    server: Any, visit: Any, start: Any, unused_tcp_port_factory: Any = None
) -> None:
    pid, client = start()
    here = visit(str(client.base_url).rstrip("/"))
    here.begin()
    here.say("Surround the largest coin")
    here.page.click("#go")
    here.page.click("#approve")
    expect(here.page.locator("#stop.urgent")).to_have_count(1, timeout=LONG)
    os.kill(pid, signal.SIGKILL)
    expect(here.page.locator("#connection")).to_contain_text("Connection lost", timeout=LONG)
    here.page.fill("#words", "are they there?")
    here.page.keyboard.press("Enter")
    expect(here.page.locator("#problem")).to_contain_text("cannot be reached", timeout=LONG)
    expect(here.page.locator("#words")).to_have_value("are they there?")
    start(str(client.base_url.port))
    expect(here.page.locator("#connection")).to_have_text("", timeout=LONG)
    here.page.keyboard.press("Enter")
    here.rest()
    here.say("go")
    expect(here.page.locator("#log > li").last).to_have_attribute("data-status", "deployed")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS)
def test_every_screen_fits_and_is_usable_by_all(
    server: Any, visit: Any, width: int, scheme: str
) -> None:
    here = visit(server.url, viewport={"width": width, "height": 844}, color_scheme=scheme)
    here.page.goto(here.url)
    here.page.locator("#examples button").first.wait_for(timeout=LONG)
    check(here)
    here.begin()
    here.say("Surround the coin")
    check(here)
    here.say("c1")
    here.say("a bit further out")
    check(here)
    here.page.click("#go")
    check(here)


def check(here: Any) -> None:
    """Nothing is cut off at the side, and axe finds nothing."""
    width = here.page.viewport_size["width"]
    assert here.page.evaluate("document.documentElement.scrollWidth") <= width
    found: list[Any] = Axe().run(here.page).response["violations"]
    assert [(v["id"], v["nodes"][0]["html"][:200]) for v in found] == []


class Hands:
    """Does anything at all with a page."""

    def __init__(self, page: Any, seed: int) -> None:
        self.page, self.chance = page, random.Random(seed)
        self.stage = page.locator("#stage").bounding_box()

    def somewhere(self) -> tuple[float, float]:
        x = self.stage["x"] + self.chance.random() * self.stage["width"]
        return x, self.stage["y"] + self.chance.random() * self.stage["height"]

    def drag(self) -> None:
        self.page.mouse.move(*self.somewhere())
        self._pressed()

    def drag_robot(self) -> None:
        marks = self.page.locator(".robot .disc").all()
        box = self.chance.choice(marks).bounding_box() if marks else None
        if box is not None:
            self.page.mouse.move(box["x"] + 3, box["y"] + 3)
            self._pressed()

    def _pressed(self) -> None:
        self.page.mouse.down()
        self.page.mouse.move(*self.somewhere(), steps=3)
        if self.chance.random() < 0.1:
            self.page.keyboard.press("Escape")
        self.page.mouse.up()

    def press(self) -> None:
        self.page.keyboard.press(self.chance.choice(KEYS))

    def turn_wheel(self) -> None:
        self.page.mouse.move(*self.somewhere())
        self.page.mouse.wheel(0, self.chance.choice([-300, 300]))

    def click(self) -> None:
        self.page.mouse.click(*self.somewhere())


@pytest.mark.parametrize("seed", range(2))
def test_random_gestures_leave_page_and_server_agreed(server: Any, visit: Any, seed: int) -> None:
    here = visit(server.url)
    here.begin()
    here.say("Surround the largest coin")
    page, hands = here.page, Hands(here.page, seed)
    gestures = [hands.drag, hands.drag_robot, hands.drag_robot, hands.press, hands.turn_wheel]
    for _ in range(FUZZED):
        hands.chance.choice([*gestures, hands.click])()
        if page.locator("dialog[open]").count():
            page.keyboard.press("Escape")
    page.wait_for_timeout(1500)
    here.rest()
    current = server.client.get(here.session).json()["current"]
    page.reload()
    expect(page.locator(".robot").first).to_be_attached(timeout=LONG)
    scene = server.client.get(f"{here.session}/scene").json()
    assert scene["current"] == current
    assert page.locator(".robot").count() == len(scene["plan"]["robots"])
