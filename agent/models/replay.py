"""A recorded run in a model's place: the same replies, as long as everything else is the same."""

from itertools import zip_longest
from pathlib import Path
from typing import Any

from ...tools.errors import ModelError
from ..messages import Reply
from ..model import Request
from ..trace import message_facts, prompt_name, read_trace

LONGEST = 120
"""Characters of a message that an error repeats."""


class ReplayModel:
    """Gives the replies of a trace, and refuses to where the conversation is another one.

    Attributes:
        name: of the model that gave them.
        prompt: the prompt it was given then, or None.

    Raises:
        InputError: no trace can be read there.
    """

    def __init__(self, path: Path) -> None:
        trace = read_trace(path)
        self._path = path
        self._lines = trace.of_type("message")
        self.name = str(trace.start["model"])
        self.prompt = prompt_name(trace.start["prompt"])

    async def reply(self, request: Request) -> Reply:
        """The recorded reply to the same messages.

        Raises:
            ModelError: they are others, or the recording ends here.
        """
        count = len(request.messages)
        for number, (line, message) in enumerate(
            zip_longest(self._lines[:count], request.messages), start=1
        ):
            now = message_facts(message)
            if line is None or _facts(line) != now:
                raise ModelError(self._parted(number, line, now))
        if count == len(self._lines):
            raise ModelError(f"The recording {self._path} ends after message {count}.")
        facts = _facts(self._lines[count])
        if facts.pop("role") != "assistant":
            raise ModelError(self._parted(count + 1, self._lines[count], None))
        return Reply.model_validate({k: v for k, v in facts.items() if k != "images"})

    def _parted(self, number: int, line: dict[str, Any] | None, now: dict[str, Any] | None) -> str:
        then_text = "nothing" if line is None else repr(_short(line.get("text", "")))
        now_text = "a request" if now is None else repr(_short(now.get("text", "")))
        return (
            f"The recording {self._path} parts from this run at message {number}: it was "
            f"{then_text} and is {now_text} now; replay it with the same picture, instruction and "
            "options."
        )


def _facts(line: dict[str, Any]) -> dict[str, Any]:
    """A line of the recording as `message_facts` would say it."""
    facts = {k: v for k, v in line.items() if k not in ("type", "seconds")}
    return facts | {"images": [{"sha256": image["sha256"]} for image in line["images"]]}


def _short(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
