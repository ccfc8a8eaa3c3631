"""The display of a chat's turns: a line for each tool step, the result, and the picture."""

import time
from collections.abc import Sequence
from pathlib import Path

from PIL import Image
from rich.console import Console

from ..agent.messages import Message, Reply, Result
from ..agent.report import Report
from ..tools.draw.change import draw_small
from .chat_lines import Shown
from .run_display import STATUS_STYLE, certificate_lines, choice_words
from .terminal import say, styled, under
from .terminal_picture import Way, show_picture

COLUMN = 14
"""The column at which texts begin, behind their names."""
NAMED = "{:>12}  "


class Display:
    """Shows turns as they go.

    Args:
        console: for styled output; None for plain lines of text alone.
        way: how pictures are shown, besides naming their files.
    """

    def __init__(self, console: Console | None, way: Way) -> None:
        self._console = console
        self._way: Way = way
        self._last = 0.0
        self._streamed, self._open = "", False  # the reply shown so far; is its line open

    def fragment(self, text: str | None) -> None:
        """Show more of a reply's text as it streams; None voids what was shown of it."""
        if text is None:
            if self._streamed:
                self.line("note", "The reply broke off and starts again.")
            self._streamed = ""
            return
        begins = not self._streamed
        text = text.lstrip() if begins else text
        if not text:
            return
        if self._console is None:
            say(f"formup: {text}" if begins else text, end="")
        else:
            name = (NAMED.format("formup") if begins else "", "cyan")
            self._console.print(styled(name, under(text, COLUMN)), end="", soft_wrap=True)
        self._streamed, self._open = self._streamed + text, True

    def step(self, message: Message) -> None:
        """Show a message of a turn as it comes."""
        now, since = time.monotonic(), self._last
        self._last = now
        if isinstance(message, Reply) and not message.calls:
            return  # `show` prints its text
        streamed, self._streamed = self._streamed, ""
        if isinstance(message, Reply) and message.text.strip() and not streamed:
            self.line("formup", message.text)
        elif isinstance(message, Result) and message.name != "ask_user":
            failed = f" ({message.error})" if message.error else ""
            self.line("step", f"{message.name}, {now - since:.2f} s{failed}")

    def show(self, shown: Shown, folder: Path) -> None:
        """Show the result of a line, whose files are in the folder."""
        report = shown.report
        streamed, self._streamed = self._streamed.rstrip(), ""
        rest = report.message.strip().removeprefix(streamed).lstrip()
        self._end_line()
        status = "" if report.status == "answered" else report.status
        head = f"{status}: " if status and rest else status
        if streamed and not (head or rest):
            return
        if self._console is None:
            say(f"formup: {head}{rest}")
        else:
            self._console.print(styled((head, STATUS_STYLE[report.status]), rest))
        for choice in report.candidates or ():
            self.line("choice", choice_words(choice))
        if report.candidates:
            self.line("or", "/point X,Y, the thing's place in the picture")
        if shown.changed and report.verdict is not None:
            for name, text in certificate_lines(report):
                self.line(name, text)
        files = report.files or {}
        if picture := files.get("picture"):
            self._picture(shown, folder / picture)
        if film := files.get("animation"):
            self.line("film", str(folder / film))

    def line(self, name: str, text: str) -> None:
        """Print a text behind its name."""
        self._end_line()
        if self._console is None:
            say(f"{name}: {text}")
        else:
            self._console.print(styled((NAMED.format(name), "cyan"), under(text, COLUMN)))

    def _end_line(self) -> None:
        if self._open:
            say("")
        self._open = False

    def _picture(self, shown: Shown, path: Path) -> None:
        if self._console is not None and self._way != "none":
            context, report = shown.run.context, shown.report
            world = shown.run.world.with_doubted()
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
    """Return labels and where they go, as fractions of the picture's width and height.

    The labels are the numbers of a question's choices, at the centres of their boxes, or else
    the robots' names, at their places.
    """
    places: dict[str, Sequence[float]] = dict(
        zip(report.robots or (), report.positions or (), strict=False)
    )
    if report.candidates:
        boxes = {str(c["id"]).removeprefix("c"): c["box"] for c in report.candidates}
        places = {n: ((b[0] + b[2]) / 2, (b[1] + b[3]) / 2) for n, b in boxes.items()}
    return {name: (x / size[0], y / size[1]) for name, (x, y) in places.items()}
