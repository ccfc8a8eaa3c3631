"""The window itself, on a driver of SDL that shows nothing: what it draws, and what keys do."""

import asyncio
import json
import os
import subprocess
import sys
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup import Agent, Picture, Run, TargetPrompt, load_picture
from formup.apps.window import watching
from formup.tools.context import Services, Settings
from formup.tools.fleet.protocol import Pose
from formup.tools.fleet.simulated import PERIOD, SimulatedFleet
from PIL import Image, ImageDraw

pygame = pytest.importorskip("pygame", reason="needs formup[sim]")
ROBOT, WHITE = (0, 92, 184), (255, 255, 255)
PATIENCE = 60
BOX = (190, 140, 290, 220)
BAR = 40
Work = Callable[["Watched"], Coroutine[Any, Any, None]]


def scene() -> Image.Image:
    """A page's picture is twice as large: 960 x 720 px."""
    image = Image.new("RGB", (480, 360), "white")
    ImageDraw.Draw(image).rectangle(BOX, (40, 40, 40))
    return image


@pytest.fixture
def picture(tmp_path: Path) -> Picture:
    scene().save(tmp_path / "scene.png")
    return load_picture(tmp_path / "scene.png")


@pytest.fixture(autouse=True)
def unseen(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield
    pygame.display.quit()


class Watched:
    """A drive that is watched, as a person at the window has it."""

    def __init__(self, services: Services) -> None:
        self.services = services
        self.poses: list[tuple[Pose, ...]] = []
        services.watch = self.poses.append

    @property
    def fleet(self) -> SimulatedFleet:
        fleet = self.services.fleets["simulated"]
        assert isinstance(fleet, SimulatedFleet)
        return fleet

    async def until(self, true: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not true():
                await asyncio.sleep(0.01)

    def press(self, key: int, text: str = "") -> None:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key, unicode=text))

    async def pause(self) -> None:
        await self.until(lambda: len(self.poses) > 5)
        self.press(pygame.K_SPACE, " ")
        await self.until(lambda: self.fleet.pace.paused)
        await asyncio.sleep(6 * PERIOD)  # the step that was under way ends
        await self.drawn()

    async def drawn(self) -> None:
        """Wait until what happened so far is on the screen."""
        pygame.event.post(pygame.event.Event(pygame.USEREVENT))
        await self.until(lambda: not pygame.event.peek(pygame.USEREVENT))
        await asyncio.sleep(0)

    def screen(self) -> np.ndarray[Any, Any]:
        return pygame.surfarray.array3d(pygame.display.get_surface())


def watch(picture: Picture, work: Work, words: str = "Surround it with 4 robots") -> Run:
    async def both(services: Services) -> Run:
        watched = Watched(services)
        pointed = TargetPrompt(id="t1", box=BOX)
        settings = Settings(robot_radius=4)
        run = asyncio.ensure_future(
            Agent().arun(picture, words, pointed=[pointed], settings=settings, services=services)
        )
        try:
            await work(watched)
        except BaseException:
            run.cancel()
            raise
        return await run

    with watching(True) as services:
        return asyncio.run(both(services))


def assert_robots_at(watched: Watched, low: tuple[int, int], scale: float) -> int:
    """That bodies are where robots are, to a pixel; how many of them are to be seen."""
    screen, seen = watched.screen(), 0
    for pose in watched.poses[-1]:
        x, y = (np.array([pose.x, pose.y]) - low + 0.5) * scale - 0.5 + (0, BAR)
        if not (20 < x < 940 and BAR + 20 < y < 740):
            continue
        around = screen[round(x) - 15 : round(x) + 16, round(y) - 15 : round(y) + 16]
        blue = np.argwhere(np.all(around == ROBOT, axis=2))
        assert len(blue), f"robot {pose.id} is not drawn at ({x:.0f}, {y:.0f})"
        assert np.abs(blue.mean(axis=0) - 15).max() <= 1
        width = np.ptp(blue, axis=0) + 1
        assert np.all(width <= 8 * scale) and np.all(width >= 5 * scale), "not to scale"
        seen += 1
    return seen


def test_time_stands_still_goes_by_steps_and_goes_on(picture: Picture) -> None:
    async def work(watched: Watched) -> None:
        await watched.pause()
        before = len(watched.poses)
        for _ in range(5):
            await watched.drawn()
        assert len(watched.poses) == before
        for _ in range(2):
            now, seen = len(watched.poses), watched.poses[-1][0].seen
            watched.press(pygame.K_PERIOD, ".")
            await watched.until(lambda now=now: len(watched.poses) > now)
            await watched.drawn()
            assert len(watched.poses) == now + 1
            assert watched.poses[-1][0].seen == pytest.approx(seen + PERIOD)
        watched.press(pygame.K_PLUS, "+")
        await watched.until(lambda: watched.fleet.pace.speed == 2)
        for _ in range(9):
            watched.press(pygame.K_PLUS, "+")
        watched.press(pygame.K_SPACE, " ")
        await watched.until(lambda: not watched.fleet.pace.paused)
        assert watched.fleet.pace.speed is None

    assert watch(picture, work).report.status == "deployed"


def test_robots_are_drawn_where_they_are_also_enlarged(picture: Picture) -> None:
    async def work(watched: Watched) -> None:
        await watched.pause()
        assert assert_robots_at(watched, (0, 0), 2.0) == 4
        for _ in range(10):
            watched.fleet.pace.steps += 1
            await watched.until(lambda: not watched.fleet.pace.steps)
        watched.press(pygame.K_i, "i")
        await watched.drawn()
        assert assert_robots_at(watched, (48, 36), 2.5) > 0
        drag = {"pos": (0, 0), "rel": (100, 50), "buttons": (1, 0, 0)}
        pygame.event.post(pygame.event.Event(pygame.MOUSEMOTION, drag))
        await watched.drawn()
        assert assert_robots_at(watched, (8, 16), 2.5) > 0
        pygame.event.post(pygame.event.Event(pygame.MOUSEWHEEL, y=-1))
        watched.press(pygame.K_f, "f")
        await watched.drawn()
        assert assert_robots_at(watched, (0, 0), 2.0) == 4
        watched.press(pygame.K_SPACE, " ")

    assert watch(picture, work).report.status == "deployed"


@pytest.mark.parametrize("way", ["q", "escape", "closed"])
def test_closing_it_on_the_way_holds_the_robots(picture: Picture, way: str) -> None:
    async def work(watched: Watched) -> None:
        await watched.pause()
        if way == "closed":
            pygame.event.post(pygame.event.Event(pygame.QUIT))
        else:
            watched.press(pygame.K_ESCAPE if way == "escape" else pygame.K_q, "q"[: way == "q"])
        await watched.until(lambda: watched.services.is_stopped)

    run = watch(picture, work)
    assert run.report.status == "stopped" or "stopped" in run.report.message
    assert not run.report.arrival or not run.report.arrival.arrived
    assert not pygame.display.get_init()


def formup(*arguments: object, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "formup", *map(str, arguments)]
    hidden = ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY")
    kept = {k: v for k, v in os.environ.items() if k not in hidden} | environment
    return subprocess.run(command, env=kept, capture_output=True, text=True, check=False)


def told(folder: Path, *options: object) -> list[object]:
    scene().save(folder / "scene.png")
    box = ",".join(map(str, BOX))
    words = "Surround it with 3 robots"
    return ["run", folder / "scene.png", words, "--box", box, "--out", folder / "out", *options]


def test_a_program_that_watches_gets_one_object_and_never_hangs(tmp_path: Path) -> None:
    done = formup(*told(tmp_path, "--watch", "--json"), SDL_VIDEODRIVER="dummy")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["status"] == "deployed"
    plan = tmp_path / "out/plan.json"
    again = formup("deploy", plan, "--watch", "--json", SDL_VIDEODRIVER="dummy")
    assert json.loads(again.stdout)["status"] == "deployed"


def test_a_chat_is_watched_turn_after_turn(tmp_path: Path) -> None:
    said = tmp_path / "talk.txt"
    said.write_text("Surround it with 3 robots\ngo\nadd two\ngo\n", "utf-8")
    how = ["--box", ",".join(map(str, BOX)), "--script", said, "--json", "--watch"]
    where = ["--out", tmp_path / "out", "--store", tmp_path / "store"]
    scene().save(tmp_path / "scene.png")
    done = formup("chat", tmp_path / "scene.png", *how, *where, SDL_VIDEODRIVER="dummy")
    assert done.returncode == 0, done.stderr
    status = [json.loads(line)["status"] for line in done.stdout.splitlines()]
    assert status == ["planned", "deployed", "planned", "deployed"]


def test_without_a_display_it_says_so_and_leaves_the_film(tmp_path: Path) -> None:
    done = formup(*told(tmp_path, "--watch", "--film", tmp_path / "film.png"))
    assert done.returncode == 0, done.stderr
    why = "formup: this machine has no display; watch the film in the output folder instead.\n"
    assert why in done.stderr
    assert (tmp_path / "out/deploy.gif").exists()
    with Image.open(tmp_path / "film.png") as strip:
        assert strip.width > strip.height
    assert "film.png" in "".join(done.stdout.split()), "lines break anywhere"


def test_without_its_library_it_says_what_to_install(tmp_path: Path) -> None:
    lacking = tmp_path / "lacking"
    lacking.mkdir()
    (lacking / "pygame.py").write_text("raise ImportError\n", "utf-8")
    paths = os.pathsep.join([str(lacking), os.environ.get("PYTHONPATH", "")])
    done = formup(*told(tmp_path, "--watch"), PYTHONPATH=paths)
    assert done.returncode == 2
    assert done.stderr == "formup: --watch needs an extra: pip install 'formup[sim]'.\n"


@pytest.mark.parametrize("name", ["film.avi", "film", "nowhere/film.mp4"])
def test_a_film_that_cannot_be_is_refused_before_the_run(tmp_path: Path, name: str) -> None:
    done = formup(*told(tmp_path, "--film", tmp_path / name))
    assert done.returncode == 2
    form = "name a file ending in .gif, .mp4, .png in an existing folder."
    assert done.stderr == f"formup: --film {tmp_path / name} cannot be written; {form}\n"
    assert not (tmp_path / "out").exists()
