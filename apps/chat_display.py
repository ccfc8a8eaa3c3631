"""What a turn of a chat shows: a line for each step of a tool, what came of it, the picture."""

import time
from collections.abc import Sequence
from pathlib import Path

from PIL import Image
from rich.console import Console

from ..agent.messages import Message, Reply, Result, User
from ..agent.report import Report
from ..tools.draw.change import draw_small
from .chat_lines import Shown
from .run_display import STATUS_STYLE, certificate_lines, choice_words
from .terminal import say, styled, under
from .terminal_picture import Way, show_picture

COLUMN = 14
"""Where texts begin."""


class Display:
    """Shows turns as they go.

    Args:
        folder: of the files.
        console: for a person who sees; None for nothing but lines of text.
        way: how pictures are shown beside their files.
    """

    def __init__(self, folder: Path, console: Console | None = None, way: Way = "none") -> None:
        self._folder, self._console = folder, console
        self._way: Way = way
        self._last = 0.0

    def step(self, message: Message) -> None:
        """A message of a turn as it comes."""
        now, since = time.monotonic(), self._last
        self._last = now
        if isinstance(message, User):
            return
        if isinstance(message, Reply) and message.calls and message.text.strip():
            self.line("formup", message.text)
        elif isinstance(message, Result) and message.name != "ask_user":
            failed = f" ({message.error})" if message.error else ""
            self.line("step", f"{message.name}, {now - since:.2f} s{failed}")

    def show(self, shown: Shown) -> None:
        """What came of a line."""
        report = shown.report
        status = "" if report.status == "answered" else f"{report.status}: "
        if self._console is None:
            say(f"formup: {status}{report.message}")
        else:
            head = (status, STATUS_STYLE[report.status])
            self._console.print(styled(head, report.message))
        for choice in report.candidates or ():
            self.line("choice", choice_words(choice))
        if shown.changed and report.verdict is not None:
            for name, text in certificate_lines(report):
                self.line(name, text)
        files = report.files or {}
        if picture := files.get("picture"):
            self._picture(shown, self._folder / picture)
        if film := files.get("animation"):
            self.line("film", str(self._folder / film))

    def line(self, name: str, text: str) -> None:
        """A text with its name before it."""
        if self._console is None:
            say(f"{name}: {text}")
        else:
            self._console.print(styled((f"{name:>12}  ", "cyan"), under(text, COLUMN)))

    def _picture(self, shown: Shown, path: Path) -> None:
        if self._console is not None and self._way != "none":
            context, world, report = shown.run.context, shown.run.world, shown.report
            node = world.plans.get(report.plan_id or "")
            plan = None if node is None or report.candidates else node.plan
            with Image.open(path) as page:
                show_picture(
                    self._console,
                    self._way,
                    page.convert("RGB"),
                    lambda room: draw_small(context.picture, world, plan, shown.before, room),
                    _names(report, context.picture.size),
                )
        self.line("picture", str(path))


def _names(report: Report, size: tuple[int, int]) -> dict[str, tuple[float, float]]:
    """The numbers of a question's choices in their middles, else the robots' at their places."""
    places: dict[str, Sequence[float]] = dict(
        zip(report.robots or (), report.positions or (), strict=False)
    )
    if report.candidates:
        boxes = {str(c["id"]).removeprefix("c"): c["box"] for c in report.candidates}
        places = {n: ((b[0] + b[2]) / 2, (b[1] + b[3]) / 2) for n, b in boxes.items()}
    return {name: (x / size[0], y / size[1]) for name, (x, y) in places.items()}
