"""`--watch`: a window that shows robots while they drive, and controls their time.

It is drawn in the thread of the event loop, which for SDL has to be the main one, between steps:
at most 30 times a second, and with rests as long as drawing takes, so as not to slow robots down.
"""

import asyncio
import os
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import typer
from PIL import Image

from ..tools.context import Context, Services, Shown
from ..tools.draw.canvas import ALLOWED, FINDING, IDLE, INK, MUTED, PAPER, ROBOT, TARGET, WHITE
from ..tools.draw.live import BAR, EDGE, HEAD, PANEL, Course, Ground, body, words
from ..tools.errors import FleetError, InputError
from ..tools.fleet.follow import Rigid
from ..tools.fleet.pace import Pace, pace_of
from ..tools.fleet.protocol import Fleet, Pose
from ..tools.formation.plan import Plan
from .terminal import say

if TYPE_CHECKING:
    from pygame import Surface
    from pygame.event import Event

Draw = Callable[..., Image.Image]
FRAME, REST = 1 / 30, 0.1
"""Least seconds from one frame to the next, and the longest rest after a slow frame."""
SIZE, ROW = (1230, 760), 21
SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, None)
"""Simulated seconds per second; None for as many as can be computed."""
ZOOM, PAN = 1.25, 60
NUMBERED, TRAILED, BANDS = 60, 400, 4
"""Most robots shown with numbers and lines to places; most with trails; bands of a fading trail."""
INSIDE, BESIDE = 10.0, 22.0
"""Least radius, px, of a body with its number inside; else least distance, px, to the next robot
for a number beside it."""
HEADLESS = ("dummy", "offscreen")
"""SDL drivers that show nothing."""
TIME = (("Space", "pause, go on"), (".", "one step"), ("+  -", "faster, slower"))
VIEW = (("wheel, I O", "zoom in, out"), ("drag, arrows", "move the picture"), ("F", "all of it"))
KEYS = len(TIME) + len(VIEW) + 1


class Window:
    """A window that shows one drive after another."""

    def __init__(self) -> None:
        import pygame

        self._pygame, self._open, self._speed = pygame, False, SPEEDS.index(1.0)
        self._task: asyncio.Task[None] | None = None
        self._look: Any = None

    @contextmanager
    def follow(self, context: Context, plan: Plan, fleet: Fleet) -> Generator[Shown]:
        """Show a drive; see `Services.view`."""
        world, display = context.world, self._pygame.display
        radius = max(plan.formation.contract.robot_radius, fleet.radius)
        title = world.plans[plan.id].words or context.words
        self._ground = Ground(context.picture, world, plan, title, radius)
        self._course, self._fleet = Course(plan, world.picture.size, radius), fleet
        self._scale, self._changed = world.metres_per_pixel, True
        self._pace = pace_of(fleet)
        if self._pace is not None:
            self._pace.speed = SPEEDS[self._speed]
        if not self._open:
            display.init()
            display.set_mode(SIZE, self._pygame.RESIZABLE)
            display.set_caption("formup")
            self._open = True
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._serve())
        try:
            yield self._see
        finally:
            self._course.ended = self._changed = True

    def stay(self) -> None:
        """Stay open until a person closes the window; return at once if nobody can see it."""
        while self._open and self._pygame.display.get_driver() not in HEADLESS and self._turn():
            time.sleep(FRAME)

    def close(self) -> None:
        """Close the window."""
        self._open = False
        self._pygame.display.quit()

    def _see(self, poses: tuple[Pose, ...], moved: Rigid | None = None) -> None:
        if self._open:
            self._course.see(poses, moved)
            self._changed = True

    async def _serve(self) -> None:
        """Draw and handle input until the window is closed, then hold robots that still drive."""
        while self._open and self._turn():
            await asyncio.sleep(max(FRAME - self._took, min(self._took, REST)))
        self.close()
        if self._course.ended:
            return
        try:
            await self._fleet.stop()
        except FleetError as error:
            say(f"formup: the robots could not be held: {error}", error=True)
        if self._pace is not None:
            self._pace.paused = False  # a step that waits would never see the stop

    def _turn(self) -> bool:
        """Handle input, and draw if anything has changed; return False to close the window."""
        began = time.perf_counter()
        for event in self._pygame.event.get():
            self._changed = True
            if not self._handle_event(event):
                return False
        if self._changed and self._course.poses:
            self._changed = False
            self._draw(self._pygame.display.get_surface())
            self._pygame.display.flip()
        self._took = time.perf_counter() - began
        return True

    def _handle_event(self, event: "Event") -> bool:
        """Handle an event; return False if it closes the window."""
        pygame, ground = self._pygame, self._ground
        if event.type == pygame.MOUSEWHEEL:
            ground.zoom(ZOOM**event.y, pygame.mouse.get_pos())
        elif event.type == pygame.MOUSEMOTION and event.buttons[0]:
            ground.pan(event.rel)
        elif event.type == pygame.KEYDOWN:
            typed = event.unicode.lower()
            ways = {pygame.K_LEFT: (PAN, 0), pygame.K_RIGHT: (-PAN, 0)}
            ways |= {pygame.K_UP: (0, PAN), pygame.K_DOWN: (0, -PAN)}
            if event.key in ways:
                ground.pan(ways[event.key])
            elif typed in ("i", "o", "f"):
                ground.zoom({"i": ZOOM, "o": 1 / ZOOM, "f": 0.0}[typed])
            elif self._pace is not None:
                self._set(self._pace, typed)
            return typed != "q" and event.key != pygame.K_ESCAPE
        return event.type != pygame.QUIT

    def _set(self, pace: Pace, typed: str) -> None:
        """Handle a key that controls time."""
        if typed == " ":
            pace.paused = not pace.paused
        elif typed == ".":
            pace.steps += pace.paused
            pace.paused = True
        elif typed in ("+", "=", "-"):
            speed = self._speed + (-1 if typed == "-" else 1)
            self._speed = min(max(speed, 0), len(SPEEDS) - 1)
            pace.speed = SPEEDS[self._speed]

    def _draw(self, screen: "Surface") -> None:
        ground, size = self._ground, screen.get_size()
        if (ground, ground.look, size) != self._look:
            self._page = _sprite.__wrapped__(ground.draw, (size,))
            self._look = ground, ground.look, size
        screen.blit(self._page, (0, 0))
        left, top, right, bottom = ground.canvas.photo
        screen.set_clip((left, top, right - left, bottom - top))
        self._draw_ways(screen)
        self._draw_bodies(screen)
        screen.set_clip(None)
        self._draw_figures(screen)

    def _draw_ways(self, screen: "Surface") -> None:
        """Draw fading trails behind robots, lines to their places, a followed thing's outline."""
        course, draw, at = self._course, self._pygame.draw, self._ground.canvas.at
        trail = np.stack([at(points) for points in course.trail])
        links = [at(link) for link in course.links if len(course.links) <= NUMBERED]
        layer = self._pygame.Surface(screen.get_size(), self._pygame.SRCALPHA)
        for link in links:
            draw.line(layer, (*INK, 110), *link, 3)
        if trail.shape[1] <= TRAILED and len(trail) > BANDS:
            for k, part in enumerate(np.array_split(np.arange(len(trail) - 1), BANDS), start=1):
                for way in np.swapaxes(trail[part[0] : part[-1] + 2], 0, 1):
                    draw.lines(layer, (*ALLOWED, 220 * k // BANDS), False, way, 3)
        screen.blit(layer, (0, 0))
        for link in links:
            draw.aaline(screen, PAPER, *link)
        for ring in self._ground.seen(course.moved) if course.moved else ():
            draw.lines(screen, TARGET, True, ring, 3)

    def _draw_bodies(self, screen: "Surface") -> None:
        course, canvas, radius = self._course, self._ground.canvas, round(self._ground.body, 1)
        centres, placed = canvas.at(course.trail[-1]), set(course.robots)
        for pose, at in zip(course.poses, centres, strict=True):
            if pose.heading is not None:
                way = np.array([np.cos(pose.heading), np.sin(pose.heading)])
                for reach, colour, width in ((1.9, INK, 5), (1.8, WHITE, 3)):
                    self._pygame.draw.line(screen, colour, at, at + reach * radius * way, width)
        for pose, at, apart in zip(course.poses, centres, course.apart, strict=True):
            colour = ROBOT if pose.id in placed else IDLE
            colour = FINDING if apart < course.demanded else colour
            self._put(screen, at, body, radius, colour)
            if len(centres) <= NUMBERED and radius >= INSIDE:
                self._put(screen, at, words, pose.id, WHITE, colour)
            elif len(centres) <= NUMBERED and canvas.page_length(apart) >= BESIDE:
                beside = at + np.array([radius + 6, -radius - 6])
                self._put(screen, beside, words, pose.id, WHITE, INK)

    def _draw_figures(self, screen: "Surface") -> None:
        course, width, height = self._course, *screen.get_size()
        left, right, y = width - PANEL + EDGE, width - EDGE, BAR + 38.0
        state, ground = course.state(self._pace, held=self._fleet.stopped)
        box = self._pygame.draw.rect(screen, ground, (left, BAR, right - left, 30), border_radius=4)
        self._put(screen, np.array(box.center), words, state, PAPER)
        most = (height - int(y) - EDGE) // ROW - KEYS - 2
        for name, value, colour in course.figures(self._pace, self._scale, most):
            if colour == HEAD:
                self._pygame.draw.line(screen, HEAD, (left, y + 5), (right, y + 5))
                y += 10
            self._put(screen, np.array([left, y + ROW / 2]), words, name, MUTED, side=0)
            self._put(screen, np.array([right, y + ROW / 2]), words, value, colour, side=1)
            y += ROW
        leave = "close" if course.ended else "hold robots, close"
        keys = (*(TIME if self._pace is not None else ()), *VIEW, ("Q", leave))
        for i, (key, meaning) in enumerate(keys):
            y = height - EDGE - ROW * (len(keys) - i - 0.5)
            self._put(screen, np.array([left, y]), words, key, ALLOWED, side=0)
            self._put(screen, np.array([left + 105, y]), words, meaning, MUTED, side=0)

    def _put(self, screen: "Surface", at: Any, draw: Draw, *how: Any, side: float = 0.5) -> None:
        """Put a drawing on a point of the page, by its left edge, middle or right (0, 0.5, 1)."""
        surface = _sprite(draw, how)
        (x, y), (wide, high) = at, surface.get_size()
        screen.blit(
            surface, (round(float(x) - (wide - 1) * side), round(float(y) - (high - 1) / 2))
        )


@lru_cache(maxsize=2000)
def _sprite(draw: Draw, how: tuple[Any, ...]) -> "Surface":
    """Return a drawn image as a surface for the screen."""
    import pygame

    image = draw(*how)
    mode: Any = image.mode
    surface = pygame.image.frombytes(image.tobytes(), image.size, mode)
    return surface.convert_alpha() if mode == "RGBA" else surface.convert()


@contextmanager
def watching(wanted: bool, *, stays: bool = True) -> Generator[Services]:
    """Yield services that show robots in a window, if wanted.

    Without a display, a note refers to the films instead.

    Args:
        stays: whether the window stays after the command until a person closes it.

    Raises:
        InputError: the library is not installed.
    """
    services, window = Services(), _window() if wanted else None
    if window is None:
        yield services
        return
    services.view = window.follow
    try:
        yield services
    except typer.Exit:  # the command has finished
        if stays:
            window.stay()
        raise
    finally:
        window.close()


def _window() -> Window | None:
    """Return a window that is still hidden; None, with a note, if it cannot be opened."""
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")  # stdout is for reports
    os.environ.setdefault("SDL_NO_SIGNAL_HANDLERS", "1")
    try:
        import pygame
    except ImportError:
        raise InputError("--watch needs an extra: pip install 'formup[sim]'.") from None
    chosen, why = "SDL_VIDEODRIVER" in os.environ, "this machine has no display"
    screens = os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"}
    try:
        if sys.platform != "linux" or screens:  # without one, SDL prints its own complaint
            pygame.display.init()
        if pygame.display.get_init() and (chosen or pygame.display.get_driver() not in HEADLESS):
            pygame.display.set_mode(SIZE, pygame.HIDDEN)
            return Window()
    except pygame.error as error:
        why = f"no window can be opened ({error})"
    say(f"formup: {why}; watch the film in the output folder instead.", error=True)
    return None
