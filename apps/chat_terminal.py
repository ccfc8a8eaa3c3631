"""The loop of a chat: with a person at a terminal, or over the lines of a script."""

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from contextlib import suppress

from pydantic_core import to_json

from ..prompts import PromptError
from ..tools.errors import FleetError, FormupError, ModelError
from .chat_display import Display
from .chat_keyboard import Typed, interrupts_to
from .chat_lines import Shown, Talk
from .main import INTERRUPTED
from .terminal import say

Ask = Callable[[Typed], Awaitable[str]]


async def converse(talk: Talk, display: Display, ask: Ask) -> int:
    """Talk with a person until they leave.

    Returns:
        The exit code.
    """
    typed, hits = Typed(), 0
    while True:
        try:
            text = await ask(typed)
        except EOFError:
            return 0
        except KeyboardInterrupt:
            hits += 1
            if hits > 1:
                return INTERRUPTED
            display.line("", "Press Ctrl-C again, or type /quit, to leave.")
            continue
        if not text.strip():
            continue
        try:
            shown, hits = await _interruptible(talk, text, display, typed)
        except (FormupError, PromptError) as error:
            display.line("error", str(error))
            continue
        if shown is None:
            return INTERRUPTED
        display.show(shown, talk.folder.path)
        if shown.ends:
            return 0


async def run_script(talk: Talk, lines: Iterable[str], display: Display | None) -> int:
    """Carry out lines in order, each finished before the next, until one fails or ends the chat.

    Blank lines and comments, which begin with #, are skipped.

    Args:
        display: None for one JSON object per line.

    Returns:
        The exit code.
    """
    for line in lines:
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        if display is not None:
            say(f"you: {text}")
        try:
            shown, hits = await _interruptible(talk, text, display)
        except (FormupError, PromptError) as error:
            asked = isinstance(error, FormupError) and error.kind == "asked"
            code = 0 if asked else 4 if isinstance(error, ModelError | FleetError) else 2
            shown, hits = talk.refused(text, str(error), "question" if asked else "failed"), 0
        else:
            code = INTERRUPTED if hits else 4 if shown and shown.report.exit_code == 4 else 0
        if shown is None:
            return INTERRUPTED
        if display is None:
            say(to_json({"turn": shown.turn, **shown.report.model_dump(mode="json")}).decode())
        else:
            display.show(shown, talk.folder.path)
        if code or shown.ends:
            return code
    return 0


async def _interruptible(
    talk: Talk, text: str, display: Display | None, typed: Typed | None = None
) -> tuple[Shown | None, int]:
    """Carry out a line; return its result and how often Ctrl-C was pressed.

    The first Ctrl-C stops the turn and the robots, as a typed line that says stop does; a
    Ctrl-C after either cancels the work, and the result is None.
    """
    work = asyncio.create_task(talk.line(text, display.step if display else None))
    stops: set[asyncio.Task[None]] = set()

    def stop() -> None:
        stops.add(asyncio.create_task(talk.stop()))

    def interrupted() -> None:
        if stops:
            work.cancel()
        stop()

    def handles(line: str) -> bool:
        if said := talk.is_stop(line):
            stop()
        return said

    with interrupts_to(interrupted) as hits:
        try:
            if typed is None:
                shown = await work
            else:
                with typed.listening(handles):
                    shown = await work
        except asyncio.CancelledError:
            shown = None
        finally:
            with suppress(FleetError):
                await asyncio.gather(*stops)
    return shown, len(hits)
