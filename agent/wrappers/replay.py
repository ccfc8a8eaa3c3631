"""A recorded run in a model's place: the same replies, as long as everything else is the same."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...tools.errors import ModelError
from ..messages import Aside, Reply
from ..model import Request
from ..recording import message_facts
from ..session import model_name, prompt_name
from ..session_start import read_session

LONGEST = 120
"""Most characters of a message that an error quotes."""


class ReplayModel:
    """A model that gives the replies of a trace, and fails where the conversation is another one.

    Attributes:
        name: of the model that gave them.
        prompt: the prompt it was given then, or None.
        sees: whether it was given the picture.

    Raises:
        InputError: no trace can be read there.
    """

    reads_all = True

    def __init__(self, path: Path) -> None:
        start, *events = read_session(path)
        self._path = path
        self._lines = [event.data for event in events if event.kind == "message"]
        self.name = model_name(start.data)
        self.prompt = prompt_name(start.data["prompt"])
        self.sees = bool(self._lines and self._lines[0]["images"])

    async def reply(self, request: Request) -> Reply:
        """Return the recorded reply to the same messages.

        Raises:
            ModelError: the messages differ, or the recording ends here.
        """
        if request.aside:
            return self._aside(request)
        count = len(request.messages)
        for number, message in enumerate(request.messages):
            then, now = self._at(number), message_facts(message)
            if _facts(then) != _facts(now):
                raise ModelError(self._parted(number + 1, then, repr(_short(now.get("text", "")))))
        line = self._at(count)
        facts = {k: v for k, v in _facts(line).items() if k not in ("role", "images")}
        if line["role"] != "assistant":
            raise ModelError(self._parted(count + 1, line, "the model's turn"))
        return Reply.model_validate(facts)

    def _aside(self, request: Request) -> Reply:
        """Return the recorded reply to what a tool asked."""
        (message,) = request.messages
        text = getattr(message, "text", "")
        for line in self._lines:
            for aside in line.get("asides", ()):
                if aside["text"] == text:
                    return Aside.model_validate(aside).reply
        raise ModelError(f"In the recording {self._path} no tool asks {_short(text)!r}.")

    def _at(self, number: int) -> Mapping[str, Any]:
        if number >= len(self._lines):
            text = f"The recording {self._path} ends after message {len(self._lines)}."
            raise ModelError(text)
        return self._lines[number]

    def _parted(self, number: int, then: Mapping[str, Any], now: str) -> str:
        text = _short(then.get("text", ""))
        return (
            f"The recording {self._path} parts from this run at message {number}: it was {text!r} "
            f"and is {now} now; replay it with the same picture, instruction and options."
        )


def _facts(line: Mapping[str, Any]) -> dict[str, Any]:
    """Return what two messages must share, as far as a model sees it: of images only the number,
    since libraries that draw and compress write other bytes in other versions."""
    facts = {
        k: v for k, v in line.items() if k not in ("cause", "facts", "asides") and v is not None
    }
    return facts | {"images": len(line["images"])}


def _short(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
