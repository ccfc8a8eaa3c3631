"""`--watch`: a window in which robots are seen while they drive, and their time is controlled.

It is drawn in the thread of the event loop, which has to be the main one for SDL, between steps;
at most 30 times a second and in a fourth of the time, so that robots are not slower for it.
"""

import asyncio
import os
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import typer
from PIL import Image

from ..tools.context import Context, Services
from ..tools.draw.canvas import ALLOWED, FINDING, IDLE, INK, MUTED, ROBOT, WHITE
from ..tools.draw.live import BAR, PANEL, Course, LivePage, body, name
from ..tools.errors import FleetError, InputError
from ..tools.fleet.pace import Pace
from ..tools.fleet.protocol import Fleet, Pose
from ..tools.formation.plan import Plan
from .terminal import say

if TYPE_CHECKING:
    from pygame import Surface
    from pygame.event import Event

FRAME, SHARE = 1 / 30, 0.25
"""Least seconds from one frame to the next, and the greatest share of time drawing may take."""
SIZE = (1230, 760)
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, None)
"""Simulated seconds a second; None for as many as can be computed."""
ZOOM, STEP = 1.25, 60.0
NUMBERED, TRAILED = 60, 400
"""Up to so many robots bear numbers and lines to their places; up to so many leave trails."""
NUMBER, ROOM = 13, 22.0
"""Size of a robot's number, and how near the next robot may be for it, px."""
HEADLESS = ("dummy", "offscreen")
"""SDL's drivers that show nothing."""


class Window:
    """A window for one drive after another.

    Attributes:
        is_open: whether it is on the screen.
    """

    def __init__(self) -> None:
        import pygame

        self._pygame, self.is_open, self._speed = pygame, False, SPEEDS.index(1.0)
        self._task: asyncio.Task[None] | None = None
        self._ground: Surface | None = None
        self._drawn: dict[Any, Surface] = {}

    @contextmanager
    def follow(
        self, context: Context, plan: Plan, fleet: Fleet
    ) -> Generator[Callable[[tuple[Pose, ...]], None]]:
        """Show a drive; what is yielded is to be given the poses of all robots."""
        world = context.world
        radius = max(plan.formation.contract.robot_radius, fleet.radius or 0.0)
        title = context.words or world.plans[plan.id].words
        self._page = LivePage(context.picture, world, plan, title, radius)
        self._course, self._fleet = Course(plan, world.picture.size, radius), fleet
        pace = getattr(fleet, "pace", None)
        self._pace = pace if isinstance(pace, Pace) else None
        self._ground, self._changed = None, True
        self._drawn.clear()
        if self._pace is not None:
            self._pace.speed = SPEEDS[self._speed]
        if not self.is_open:
            self._pygame.display.init()
            self._pygame.display.set_mode(SIZE, self._pygame.RESIZABLE)
            self.is_open = True
        self._pygame.display.set_caption(f"formup: {title}")
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._serve())
        try:
            yield partial(self._see, self._course)
        finally:
            self._course.ended, self._changed = True, True

    def stay(self) -> None:
        """Stay until a person closes it; where nobody can see it, not at all."""
        headless = self._pygame.display.get_driver() in HEADLESS
        while self.is_open and not headless and self.turn():
            time.sleep(FRAME)
        self.close()

    def close(self) -> None:
        """Take it off the screen."""
        self.is_open = False
        self._pygame.display.quit()

    def turn(self) -> bool:
        """Do what a person wants, and draw where something has changed; False to close it."""
        for event in self._pygame.event.get():
            self._changed = True
            if not self._heed(event):
                return False
        if self._changed and self._course.poses:
            self._draw()
        return True

    def _see(self, course: Course, poses: tuple[Pose, ...]) -> None:
        if self.is_open:
            course.see(poses)
            self._changed = True

    async def _serve(self) -> None:
        """Draw, and do what a person wants, until the window is closed."""
        while self.is_open:
            began = time.perf_counter()
            if not self.turn():
                await self._quit()
                return
            took = time.perf_counter() - began
            await asyncio.sleep(max(FRAME - took, took * (1 / SHARE - 1)))

    async def _quit(self) -> None:
        """Close the window; robots that nobody watches any more are held."""
        self.close()
        if self._course.ended:
            return
        try:
            await self._fleet.stop()
        except FleetError as error:
            say(f"formup: the robots could not be held: {error}", error=True)
        if self._pace is not None:
            self._pace.paused = False  # a step that waits would not learn of it

    def _heed(self, event: "Event") -> bool:
        """Do what an event asks for; False where it is to close the window."""
        pygame, page = self._pygame, self._page
        if event.type == pygame.QUIT:
            return False
        if event.type == pygame.MOUSEWHEEL:
            self._look(lambda: page.zoom(ZOOM**event.y, pygame.mouse.get_pos()))
        elif event.type == pygame.MOUSEMOTION and event.buttons[0]:
            self._look(lambda: page.pan(event.rel))
        elif event.type == pygame.KEYDOWN:
            if event.key == pygame.K_ESCAPE or event.unicode in ("q", "Q"):
                return False
            self._press(event)
        return True

    def _press(self, event: "Event") -> None:
        """Do what a key is for."""
        pygame, page = self._pygame, self._page
        ways = {
            pygame.K_LEFT: (STEP, 0),
            pygame.K_RIGHT: (-STEP, 0),
            pygame.K_UP: (0, STEP),
            pygame.K_DOWN: (0, -STEP),
        }
        if event.key in ways:
            self._look(lambda: page.pan(ways[event.key]))
        elif (typed := event.unicode.lower()) in ("i", "o"):
            self._look(lambda: page.zoom(ZOOM if typed == "i" else 1 / ZOOM))
        elif typed == "f":
            self._look(lambda: page.zoom(0.0))
        elif self._pace is None:
            return
        elif typed == " ":
            self._pace.paused = not self._pace.paused
        elif typed == ".":
            self._pace.steps += self._pace.paused
            self._pace.paused = True
        elif typed in ("+", "=", "-"):
            by = -1 if typed == "-" else 1
            self._speed = int(np.clip(self._speed + by, 0, len(SPEEDS) - 1))
            self._pace.speed = SPEEDS[self._speed]

    def _look(self, change: Callable[[], None]) -> None:
        change()
        self._ground = None

    def _draw(self) -> None:
        """One frame."""
        screen, page, course = self._pygame.display.get_surface(), self._page, self._course
        if self._ground is None or self._ground.get_size() != screen.get_size():
            self._ground = self._surface(page.ground(screen.get_size()))
        self._changed = False
        screen.blit(self._ground, (0, 0))
        screen.set_clip(page.photo)
        self._draw_ways(screen)
        self._draw_bodies(screen)
        screen.set_clip(None)
        held = self._fleet.stopped
        panel = page.panel(screen.get_height() - BAR, course, self._pace, held=held)
        screen.blit(self._surface(panel), (screen.get_width() - PANEL, BAR))
        self._pygame.display.flip()

    def _draw_ways(self, screen: "Surface") -> None:
        """Where robots came from, fading, and where they go."""
        page, course, draw = self._page, self._course, self._pygame.draw
        trail = np.stack(course.trail)
        if trail.shape[1] <= TRAILED and len(trail) > 1:
            layer = self._pygame.Surface(screen.get_size(), self._pygame.SRCALPHA)
            paths = page.at(trail.reshape(-1, 2)).reshape(trail.shape)
            parts = np.array_split(np.arange(len(trail)), min(4, len(trail) - 1))
            for k, part in enumerate(parts, start=1):
                band = paths[part[0] : part[-1] + 2]
                for i in range(trail.shape[1]):
                    draw.lines(layer, (*ALLOWED, 220 * k // len(parts)), False, band[:, i], 3)
            screen.blit(layer, (0, 0))
        if len(course.robots) <= NUMBERED:
            for robot, place in page.at(course.links.reshape(-1, 2)).reshape(-1, 2, 2):
                draw.aaline(screen, MUTED, robot, place)

    def _draw_bodies(self, screen: "Surface") -> None:
        page, course = self._page, self._course
        points, placed = page.at(course.trail[-1]), set(course.robots)
        radius, near = round(page.body, 1), course.apart < course.demanded
        for i, (pose, at) in enumerate(zip(course.poses, points, strict=True)):
            colour = ROBOT if pose.id in placed else IDLE
            self._put(screen, at, body, radius, FINDING if near[i] else colour)
            if pose.heading is not None:
                nose = at + radius * np.array([np.cos(pose.heading), np.sin(pose.heading)])
                self._pygame.draw.line(screen, WHITE, at, nose, max(round(0.3 * radius), 2))
        if len(points) > NUMBERED:
            return
        for i, (pose, at) in enumerate(zip(course.poses, points, strict=True)):
            if radius >= NUMBER:
                self._put(screen, at, name, pose.id, NUMBER, WHITE, ROBOT)
            elif course.apart[i] * page.scale >= ROOM:
                self._put(screen, at + (radius + 6, -radius - 6), name, pose.id, NUMBER, WHITE, INK)

    def _put(self, screen: "Surface", at: Any, draw: Callable[..., Image.Image], *how: Any) -> None:
        """Put what is drawn so, once and for all, with its middle on a point of the page."""
        if (draw, how) not in self._drawn:
            self._drawn[draw, how] = self._surface(draw(*how))
        surface = self._drawn[draw, how]
        x, y = np.round(at - (np.array(surface.get_size()) - 1) / 2).astype(int).tolist()
        screen.blit(surface, (x, y))

    def _surface(self, image: Image.Image) -> "Surface":
        mode: Any = image.mode
        surface = self._pygame.image.frombytes(image.tobytes(), image.size, mode)
        return surface.convert_alpha() if mode == "RGBA" else surface.convert()


@contextmanager
def watching(wanted: bool) -> Generator[Services]:
    """Services whose robots are shown in a window where that is wanted, which then stays.

    Where there is no display, that is said, and the films have to do.

    Raises:
        InputError: the library is not installed.
    """
    services, window = Services(), _opened() if wanted else None
    if window is None:
        yield services
        return
    services.view = window.follow
    try:
        yield services
    except typer.Exit:
        window.stay()
        raise
    finally:
        window.close()


def _opened() -> Window | None:
    """A window that is not shown yet; None where there is no display."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # stdout is for reports
    os.environ.setdefault("SDL_NO_SIGNAL_HANDLERS", "1")
    try:
        import pygame
    except ImportError:
        raise InputError("--watch needs an extra: pip install 'formup[sim]'.") from None
    chosen = "SDL_VIDEODRIVER" in os.environ
    try:
        pygame.display.init()
        if chosen or pygame.display.get_driver() not in HEADLESS:
            pygame.display.set_mode(SIZE, pygame.HIDDEN)
            return Window()
        why = "this machine has no display"
    except pygame.error as error:
        why = f"no window can be opened ({error})"
    say(f"formup: {why}: watch the film among the files instead.", error=True)
    return None
