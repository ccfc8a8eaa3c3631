"""Recorded conversations in a model's place: a folder of traces, one of each task or trial."""

import hashlib
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from ...agent.fold import read_messages
from ...agent.messages import Reply
from ...agent.model import Request
from ...agent.store.folder import read_events
from ...agent.wrappers.replay import ReplayModel
from ...tools.errors import InputError, ModelError

REPLAY = "replay:"
NAMED = 80
"""Characters of a task's id in the names of its files."""
PLAN = re.compile(r"p-[0-9a-f]{10}")


def file_name(task: str) -> str:
    """A task's id as the beginning of a file's name."""
    return re.sub(r"[^\w.-]+", "_", task)[:NAMED]


@dataclass(frozen=True)
class Recordings:
    """Traces of one arm: TASK.jsonl, or TASK-TRIAL-....jsonl as a run's attempts are named."""

    folder: Path

    @property
    def name(self) -> str:
        """Of the model that they stand for: what is in them decides."""
        return _name(self.folder)

    def of(self, task: str, trial: int) -> Path | None:
        """The trace of a trial, if there is one.

        Raises:
            InputError: there are several.
        """
        called = file_name(task)
        one = self.folder / f"{called}.jsonl"
        if one.is_file():
            return one
        found = sorted(self.folder.glob(f"{called}-{trial}-*.jsonl"))
        if len(found) > 1:
            raise InputError(
                f"{self.folder} holds {len(found)} recordings of {task}, trial {trial}; keep those "
                "of one arm there."
            )
        return found[0] if found else None

    @property
    def staged(self) -> bool:
        """Whether two shared the work: one looked, another planned."""
        first = min(self.folder.glob("*.jsonl"), default=None)
        return first is not None and "+" in read_events(first)[0].data["model"]

    def seed(self, path: Path) -> int:
        """The simulator's seed at the time, on which the tools' replies depend."""
        turn = next(event for event in read_events(path) if event.kind == "turn")
        return int(turn.data["settings"].get("seed", 0))


class Spoken(ReplayModel):
    """The recorded replies in turn, whatever is said in between; plans go by their new ids."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        lines = [event.data for event in read_events(path) if event.kind == "message"]
        self._said = read_messages(lines, None)

    async def reply(self, request: Request) -> Reply:
        """The next one.

        Raises:
            ModelError: there is none.
        """
        count = len(request.messages)
        said = self._said[count] if count < len(self._said) else None
        if not isinstance(said, Reply):
            raise ModelError("The recorded replies fit no more.")
        named = {
            old: new
            for then, now in zip(self._said, request.messages, strict=False)
            for old, new in zip(PLAN.findall(then.text), PLAN.findall(now.text), strict=False)
        }
        line = said.model_dump_json()
        return Reply.model_validate_json(PLAN.sub(lambda m: named.get(m[0], m[0]), line))


def recordings(model: str) -> Recordings | None:
    """The recordings of a folder, where a model's name is that of one."""
    folder = Path(model.removeprefix(REPLAY))
    return Recordings(folder) if model.startswith(REPLAY) and folder.is_dir() else None


@lru_cache
def _name(folder: Path) -> str:
    content = hashlib.sha256()
    for path in sorted(folder.glob("*.jsonl")):
        content.update(path.name.encode() + path.read_bytes())
    return f"{REPLAY}{folder.resolve().name}#{content.hexdigest()[:12]}"
