"""A run written down as it goes, one JSON object a line: to be read, resumed and replayed.

Every line is written at once, and what a call did to the workspace before the call's result: a
process that is killed loses at most what it was doing. Keys and times of day are not in it.
"""

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO

from pydantic import ValidationError
from pydantic_core import from_json, to_json

from ...tools.errors import InputError
from ...tools.fleet.deploy import Arrival
from ...tools.store import Stored, checked, store, write_whole
from ...tools.world import Settings, Workspace
from ..messages import HISTORY, History, Reply, Result, User

FORMAT = "formup-trace-1"
NAME = "trace.jsonl"
_KEYS: dict[str, set[str]] = {
    "start": {"instruction", "model", "base_url", "prompt", "settings", "limits", "policy"},
    "state": {"workspace", "arrivals"},
    "message": {"role", "text", "images"},
    "resume": set(),
    "end": {"outcome", "status", "message", "usage"},
}
PICTURES = "pictures"
"""The folder beside a trace that holds the pictures of its messages, named by their hash."""


class TraceWriter:
    """Writes a trace.

    Args:
        path: of the file.
        resumed: whether it is gone on with; else it is begun anew.

    Raises:
        InputError: it cannot be written there.
    """

    def __init__(self, path: Path, *, resumed: bool = False) -> None:
        self.path, self._began, self._state = path, time.perf_counter(), b""
        try:
            self._file: BinaryIO = path.open("r+b" if resumed else "wb", buffering=0)
        except OSError as error:
            raise InputError(f"{path} cannot be written: {error.strerror}.") from None
        if resumed:
            whole = path.read_bytes().rpartition(b"\n")
            self._file.truncate(len(whole[0]) + len(whole[1]))  # a line may have been broken off
            self._file.seek(0, 2)

    def start(self, facts: Mapping[str, Any], workspace: Workspace) -> None:
        """What was asked, of whom, and where."""
        self._line({"type": "start", "format": FORMAT, **facts})
        self._keep(workspace)

    def resume(self, workspace: Workspace) -> None:
        """That the run goes on from here, perhaps in another process."""
        self._line({"type": "resume"})
        self._keep(workspace)

    def message(self, message: User | Reply | Result, workspace: Workspace) -> None:
        """A message, after what it has changed in the workspace."""
        if isinstance(message, Result):
            self._keep(workspace)
        facts = message_facts(message)
        for image, data in zip(facts["images"], _images(message), strict=True):
            path = f"{PICTURES}/{image['sha256'][:16]}.{_suffix(data)}"
            image |= {"bytes": len(data), "path": path}
            if not (self.path.parent / path).exists():
                (self.path.parent / PICTURES).mkdir(exist_ok=True)
                write_whole(self.path.parent / path, data)
        self._line({"type": "message", **facts})

    def end(self, facts: Mapping[str, Any]) -> None:
        """How it ended, or what it waits for."""
        self._line({"type": "end", **facts})

    def __enter__(self) -> None:
        """The file is open from the beginning; it is closed at the end."""

    def __exit__(self, *raised: object) -> None:
        self._file.close()

    def _keep(self, workspace: Workspace) -> None:
        """The workspace, where it has changed."""
        arrivals = {name: a.model_dump() for name, a in workspace.arrivals.items()}
        state = to_json({"workspace": store(workspace).model_dump(), "arrivals": arrivals})
        if state != self._state:
            self._state = state
            self._line({"type": "state"}, b"," + state[1:])

    def _line(self, facts: Mapping[str, Any], rest: bytes = b"}") -> None:
        seconds = round(time.perf_counter() - self._began, 4)
        kind = {"type": facts["type"], "seconds": seconds}
        self._file.write(to_json(kind | dict(facts))[:-1] + rest + b"\n")


@dataclass(frozen=True)
class Trace:
    """A trace as read.

    Attributes:
        path: of the file.
        lines: all of it, each a JSON object with its `type`.
    """

    path: Path
    lines: tuple[dict[str, Any], ...]

    @property
    def start(self) -> dict[str, Any]:
        """What was asked, of whom."""
        return self.lines[0]

    @property
    def model(self) -> str:
        """The name of the model or, joined by a plus, of the two that shared the work."""
        return "+".join(filter(None, (str(self.start["model"]), self.start.get("planner"))))

    @property
    def end(self) -> dict[str, Any] | None:
        """How it ended; None where it was killed."""
        return self.lines[-1] if self.lines[-1]["type"] == "end" else None

    @property
    def seconds(self) -> float:
        """How long it ran, pauses aside."""
        lasts = [
            line["seconds"]
            for line, after in zip(self.lines, (*self.lines[1:], None), strict=True)
            if after is None or after["type"] == "resume"
        ]
        return sum(lasts)

    def of_type(self, kind: str) -> list[dict[str, Any]]:
        """The lines of a type."""
        return [line for line in self.lines if line["type"] == kind]

    def messages(self) -> History:
        """The messages, their images read from beside the trace.

        Raises:
            InputError: a picture is missing or not what it was.
        """
        lines = self.of_type("message")
        return _history(lines, [[self._image(i) for i in line["images"]] for line in lines])

    def state(self) -> tuple[Stored, dict[str, Arrival]]:
        """The workspace as it was last, and the arrivals by plan id.

        Raises:
            InputError: there is none, or it is damaged or altered.
        """
        states = self.of_type("state")
        if not states:
            raise InputError(f"{self.path} was broken off before anything began; run again.")
        last = states[-1]
        try:
            arrivals = {k: Arrival.model_validate(v) for k, v in last["arrivals"].items()}
        except (ValidationError, AttributeError):
            raise InputError(f"{self.path} is damaged: its arrivals cannot be read.") from None
        return checked(last["workspace"], self.path), arrivals

    def _image(self, image: dict[str, Any]) -> bytes:
        path = self.path.parent / str(image["path"])
        try:
            data = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror}.") from None
        if hashlib.sha256(data).hexdigest() != image["sha256"]:
            raise InputError(f"{path} is not the picture that {self.path} means.")
        return data


def read_trace(path: Path) -> Trace:
    """Read a trace; a last line that was broken off is left out.

    Args:
        path: of the file, or of a folder with a trace.jsonl.

    Raises:
        InputError: missing, unreadable, or no trace.
    """
    path = path / NAME if path.is_dir() else path
    try:
        whole = path.read_bytes().rpartition(b"\n")[0]
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    try:
        return Trace(path, _lines(whole))
    except (ValueError, TypeError, KeyError, AttributeError):  # ValidationErrors are ValueErrors
        raise InputError(f"{path} is no whole trace of {FORMAT} that formup wrote.") from None


def _lines(whole: bytes) -> tuple[dict[str, Any], ...]:
    """The lines of a trace; one exception or the other where they are none."""
    lines: list[dict[str, Any]] = [from_json(line) for line in whole.split(b"\n")]
    start = lines[0]
    known = all(line["seconds"] >= 0 and line.keys() >= _KEYS[line["type"]] for line in lines)
    if not known or (start["type"], start["format"]) != ("start", FORMAT):
        raise ValueError
    prompt_name(start["prompt"])
    messages = [line for line in lines if line["type"] == "message"]
    _history(messages, [[] for _ in messages])
    return tuple(lines)


def _history(lines: Sequence[dict[str, Any]], images: Sequence[Sequence[bytes]]) -> History:
    """Messages from their lines."""
    found: list[dict[str, Any]] = []
    for line, shown in zip(lines, images, strict=True):
        facts = {k: v for k, v in line.items() if k not in ("type", "seconds", "images")}
        found.append(facts | ({} if line["role"] == "assistant" else {"images": shown}))
    return HISTORY.validate_python(found)


def prompt_name(facts: Mapping[str, Any] | None) -> str | None:
    """`id@vNNN`, or `id@draft-NAME`, of a prompt as traces and reports have it."""
    if facts is None:
        return None
    version = facts["version"]
    return f"{facts['id']}@{version if isinstance(version, str) else f'v{version:03d}'}"


def message_facts(message: User | Reply | Result) -> dict[str, Any]:
    """A message as JSON, images as their hashes."""
    facts = message.model_dump(mode="json", exclude={"images"})
    images = [{"sha256": hashlib.sha256(data).hexdigest()} for data in _images(message)]
    return facts | {"images": images}


def settings_facts(settings: Settings) -> dict[str, Any]:
    """Settings as JSON."""
    starts = settings.starts
    return asdict(settings) | {"starts": None if starts is None else starts.tolist()}


def _images(message: User | Reply | Result) -> tuple[bytes, ...]:
    return () if isinstance(message, Reply) else message.images


def _suffix(image: bytes) -> str:
    return "jpg" if image.startswith(b"\xff\xd8") else "png"
