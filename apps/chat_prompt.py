"""The prompt of a chat: a line to edit, with history across sessions and completion."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from prompt_toolkit import PromptSession
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.history import FileHistory

from .chat_keyboard import PROMPT, Typed
from .terminal import say


class Prompt:
    """Asks for messages, with history across sessions and completion.

    Args:
        history: the file that stores the history.
        words: returns what can be completed: commands, which begin with a slash, and ids.
    """

    def __init__(self, history: Path, words: Callable[[], Sequence[str]]) -> None:
        kept = FileHistory(str(history))
        with suppress(OSError):
            history.parent.mkdir(parents=True, exist_ok=True)
        self._session: PromptSession[str] = PromptSession(
            history=kept, completer=_Words(words), complete_while_typing=True
        )

    async def ask(self, typed: Typed) -> str:
        """Return the next message, already typed or asked for; "" if Ctrl-C discarded it.

        Raises:
            EOFError: the input has ended.
            KeyboardInterrupt: Ctrl-C was pressed with nothing typed.
        """
        if (text := typed.take()) is not None:
            say(f"{PROMPT}{text}")
            return text
        try:
            return await self._session.prompt_async(PROMPT)
        except KeyboardInterrupt:
            if self._session.default_buffer.text.strip():
                return ""
            raise


class _Words(Completer):
    """Completes commands as they are typed, and ids when Tab is pressed."""

    def __init__(self, words: Callable[[], Sequence[str]]) -> None:
        self._words = words

    def get_completions(
        self, document: Document, complete_event: CompleteEvent
    ) -> Iterator[Completion]:
        line = document.text_before_cursor
        word = line.rpartition(" ")[2]
        command = line.startswith("/") and word == line
        if not command and not (word and complete_event.completion_requested):
            return
        for known in self._words():
            if known.startswith(word) and known.startswith("/") == command:
                yield Completion(known, -len(word))
