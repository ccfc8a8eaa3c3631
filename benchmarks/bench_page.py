"""`python -m formup.benchmarks.bench_page FOLDER`: ten things that a newcomer tries on the page.

It drives a browser (`chromium` on the PATH) by playwright against a server of its own, writes a
screenshot of each, and prints acts and seconds; also the size of the code, the time from a click to
an outline, and frame times while one of 30 robots is dragged and 1,000 and 10,000 move.
"""

import gzip
import io
import json
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from PIL import Image

if TYPE_CHECKING:
    from playwright.sync_api import Page

PHOTOS = Path(__file__).parents[1] / "evals/photos/images"
COIN = (175, 28, 316, 162)
LONG = 60_000
FRAMES = """() => { window.frames_ = []; let last = performance.now();
  const step = (now) => {
    window.frames_.push(now - last); last = now; requestAnimationFrame(step); };
  requestAnimationFrame(step); }"""


@contextmanager
def _server(folder: str) -> Generator[str]:
    command = [sys.executable, "-m", "formup", "serve", "--port", "0", "--store", f"{folder}/store"]
    log = Path(folder) / "log"
    with log.open("w") as file, subprocess.Popen(command, stderr=file) as process:
        while not (found := re.search(r"serving on (http://\S+);", log.read_text())):
            time.sleep(0.1)
        try:
            yield found[1]
        finally:
            process.terminate()


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


class Newcomer:
    """A newcomer who uses the page, with a count of clicks, drags and sentences.

    Attributes:
        acts: number of clicks, drags and sentences since the last `tries` began.
        rows: what was tried, with its acts and seconds.
    """

    def __init__(self, page: "Page", url: str, folder: Path) -> None:
        self.page, self.url, self.folder = page, url, folder
        self.acts, self.rows = 0, list[tuple[str, int, float]]()

    def click(self, selector: str) -> None:
        """Click on an element."""
        self.acts += 1
        self.page.click(selector)

    def say(self, words: str) -> None:
        """Type words, send them, and wait for the turn to end."""
        self.acts += 1
        done = self.page.locator("#log > li[data-status]")
        before = done.count()
        self.page.fill("#words", words)
        self.page.keyboard.press("Enter")
        done.nth(before).wait_for(timeout=LONG)
        self.page.wait_for_selector("#talk:not([aria-busy])", timeout=LONG)

    def on_picture(self, x: float, y: float) -> tuple[float, float]:
        """Return where a point of the picture is on the screen, px."""
        at: list[float] = self.page.evaluate(
            "([x, y]) => { const p = new DOMPoint(x, y).matrixTransform("
            "document.querySelector('#scene').getScreenCTM()); return [p.x, p.y]; }",
            [x, y],
        )
        return at[0], at[1]

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 12) -> None:
        """Press the mouse, move it and release it; px of the screen."""
        self.acts += 1
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=steps)
        self.page.mouse.up()

    def robot(self, number: int) -> tuple[float, float]:
        """Return where the mark of a robot is on the screen, px."""
        box = self.page.locator(f'.robot[data-number="{number}"] .disc').bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def tries(self, what: str, work: Callable[[], None]) -> None:
        """Do one thing, record its acts and seconds, and save a screenshot."""
        self.acts, began = 0, time.perf_counter()
        work()
        self.rows.append((what, self.acts, time.perf_counter() - began))
        self.page.screenshot(path=self.folder / f"{len(self.rows):02}.png")


def _turns(page: "Page") -> int:
    return page.locator("#log > li[data-status]").count()


def _open(new: Newcomer) -> None:
    new.page.goto(new.url)
    new.acts += 1
    new.page.set_input_files("#file", PHOTOS / "us_coins.jpg")
    new.page.wait_for_selector("#scene image", timeout=LONG)


def _point(new: Newcomer) -> None:
    new.click("[data-tool=box]")
    new.drag(new.on_picture(*COIN[:2]), new.on_picture(*COIN[2:]))
    new.page.wait_for_selector("#pointed .chip", timeout=LONG)


def _drag(new: Newcomer) -> None:
    new.click("[data-tool=move]")
    x, y = new.robot(3)
    new.drag((x, y), (x + 25, y + 10))


def _move(new: Newcomer) -> None:
    new.click("#go")
    new.click("#approve")


def _stop(new: Newcomer) -> None:
    new.say("surround the smallest coin")
    new.say("c9")
    _move(new)
    new.page.wait_for_selector("#stop.urgent", timeout=LONG)
    new.page.wait_for_timeout(500)
    new.acts += 1
    new.page.keyboard.press("Escape")
    new.page.locator("#log > li[data-status=stopped]").wait_for(timeout=LONG)


def _share_link(new: Newcomer) -> None:
    new.click("#share")
    new.page.wait_for_selector("#shared[open]", timeout=LONG)


def _tour(new: Newcomer) -> None:
    def turn(act: Callable[[], None]) -> Callable[[], None]:
        def work() -> None:
            turns = _turns(new.page)
            act()
            new.page.locator("#log > li[data-status]").nth(turns).wait_for(timeout=LONG)
            new.page.wait_for_selector("#talk:not([aria-busy])", timeout=LONG)

        return work

    new.tries("open a photograph of one's own", lambda: _open(new))
    new.tries("point at a thing with a box", lambda: _point(new))
    new.tries("say what to do", lambda: new.say("Surround it with 8 robots, 20 px from it"))
    new.tries("a bit further out", lambda: new.say("a bit further out"))
    new.tries("drag a robot", turn(lambda: _drag(new)))
    new.tries("undo", turn(lambda: new.click("#undo")))
    new.tries("move the team, and see it arrive", turn(lambda: _move(new)))
    new.tries("ask how far robot 4 is", lambda: new.say("how far is robot 4 from it?"))
    new.tries("send it elsewhere, and stop it on the way", lambda: _stop(new))
    new.tries("share a link", lambda: _share_link(new))


def _frames(page: "Page", during: Callable[[], Any]) -> tuple[float, float]:
    """Return the median and 95th percentile of the time between frames, ms."""
    page.evaluate(FRAMES)
    during()
    times = sorted(page.evaluate("window.frames_.slice(2)"))
    return median(times), times[int(0.95 * len(times))]


def _dragging(new: Newcomer) -> None:
    page = new.page
    page.goto(new.url)
    page.fill("#robots", "30")
    page.set_input_files("#file", PHOTOS / "us_coins.jpg")
    page.wait_for_selector("#scene image", timeout=LONG)
    new.say("Surround the largest coin")
    checks = list[str]()
    page.on("response", lambda r: checks.append(r.url) if r.url.endswith("/preview") else None)
    x, y = new.robot(3)
    began = time.perf_counter()

    def drag() -> None:
        page.mouse.move(x, y)
        page.mouse.down()
        for k in range(240):
            page.mouse.move(x + 20 * (k % 12) / 12, y + 10 * (k % 7) / 7)
            page.wait_for_timeout(8)
        page.keyboard.press("Escape")
        page.mouse.up()

    middle, slow = _frames(page, drag)
    rate = len(checks) / (time.perf_counter() - began)
    _say(f"dragging one of 30: frames {middle:.0f}, 95 % {slow:.0f} ms; {rate:.0f} checks a second")


WATCHED = """async (count) => {
  const { app, tell } = await import('/page/app.js'), { width, height } = app.scene.picture;
  const robots = Array.from({ length: count }, (_, i) => ({
    id: String(i + 1), x: Math.random() * width, y: Math.random() * height, heading: null }));
  app.moving = true;
  clearInterval(window.posed);
  window.posed = setInterval(() => {
    for (const robot of robots) { robot.x += Math.random() - 0.5; robot.y += Math.random() - 0.5; }
    app.poses = robots;
    tell('poses');
  }, 50);
}"""
"""Feeds the page poses 20 times a second, as an event stream does, to measure their drawing."""


def _watching(new: Newcomer) -> None:
    for count in (1_000, 10_000):
        new.page.evaluate(WATCHED, count)
        middle, slow = _frames(new.page, lambda: new.page.wait_for_timeout(3000))
        _say(
            f"drawing {count} observed robots at 20 Hz: frames {middle:.0f} ms, 95 % {slow:.0f} ms"
        )


def _clicking(new: Newcomer, folder: Path) -> None:
    page, large = new.page, folder / "two_megapixels.png"
    with Image.open(PHOTOS / "us_coins.jpg") as photo:
        photo.resize((1622, 1254)).save(large)
    page.goto(new.url)
    page.set_input_files("#file", large)
    page.wait_for_selector("#scene image", timeout=LONG)
    page.wait_for_timeout(4000)
    page.click("[data-tool=point]")
    times = list[float]()
    for k, (x, y) in enumerate([(700, 260), (680, 760), (1350, 830), (1040, 520)]):
        with page.expect_response("**/outline") as answer:
            began = time.perf_counter()
            page.mouse.click(*new.on_picture(x, y))
        assert answer.value.ok, json.dumps(answer.value.json())
        page.locator("#pointed .chip").nth(k).wait_for(timeout=LONG)
        times.append(time.perf_counter() - began)
    _say(f"a click to its outline at 2 Mpx: median {median(times):.2f} s, worst {max(times):.2f} s")


def _sizes() -> None:
    files = [f for f in (resources.files("formup") / "apps/page").iterdir() if f.is_file()]
    data = {f.name: f.read_bytes() for f in files}
    code = {n: d for n, d in data.items() if n.endswith((".js", ".css"))}
    small = sum(len(gzip.compress(d)) for d in code.values())
    _say(f"script and style: {sum(map(len, code.values()))} bytes, {small} compressed, one by one")


def main() -> None:
    """Run the benchmark."""
    from playwright.sync_api import sync_playwright

    out = Path(sys.argv[1] if len(sys.argv) > 1 else "formup-runs/page")
    out.mkdir(parents=True, exist_ok=True)
    flags = ["--headless=new", "--no-sandbox", "--disable-gpu"]
    with TemporaryDirectory() as folder, _server(folder) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        new = Newcomer(browser.new_page(viewport={"width": 1440, "height": 900}), url, out)
        _tour(new)
        file = io.StringIO()
        file.write("| what | clicks, drags and sentences | seconds |\n|---|---|---|\n")
        file.writelines(f"| {what} | {acts} | {took:.1f} |\n" for what, acts, took in new.rows)
        _say(file.getvalue())
        _dragging(new)
        _watching(new)
        _clicking(new, Path(folder))
        browser.close()
    _sizes()


if __name__ == "__main__":
    main()
