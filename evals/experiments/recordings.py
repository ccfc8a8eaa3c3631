"""Recorded conversations instead of a model: a folder of traces, one of each task or trial."""

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
"""Most characters of a task's id in the names of its files."""
PLAN = re.compile(r"p-[0-9a-f]{10}")


def file_name(task: str) -> str:
    """Return a task's id as the beginning of a file's name."""
    return re.sub(r"[^\w.-]+", "_", task)[:NAMED]


@dataclass(frozen=True)
class Recordings:
    """Traces of one arm: TASK.jsonl, or TASK-TRIAL-....jsonl as a run's attempts are named."""

    folder: Path

    @property
    def name(self) -> str:
        """Name of the model that they stand for, with a hash of their content."""
        return _name(self.folder)

    def of(self, task: str, trial: int) -> Path | None:
        """Return the trace of a trial, if there is one.

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
        """Whether two models shared the work: one looked, another planned."""
        first = min(self.folder.glob("*.jsonl"), default=None)
        return first is not None and "+" in read_events(first)[0].data["model"]

    def seed(self, path: Path) -> int:
        """Return the simulator's seed when it was recorded, on which the tools' replies depend."""
        turn = next(event for event in read_events(path) if event.kind == "turn")
        return int(turn.data["settings"].get("seed", 0))


class RecordedReplies(ReplayModel):
    """The recorded replies in turn, whatever is said in between; plan ids become the new ones."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        lines = [event.data for event in read_events(path) if event.kind == "message"]
        self._recorded = read_messages(lines, None)

    async def reply(self, request: Request) -> Reply:
        """Return the next recorded reply.

        Raises:
            ModelError: there is none at this place in the conversation.
        """
        count = len(request.messages)
        recorded = self._recorded[count] if count < len(self._recorded) else None
        if not isinstance(recorded, Reply):
            raise ModelError("The recorded replies fit no more.")
        named = {
            old: new
            for then, now in zip(self._recorded, request.messages, strict=False)
            for old, new in zip(PLAN.findall(then.text), PLAN.findall(now.text), strict=False)
        }
        line = recorded.model_dump_json()
        return Reply.model_validate_json(PLAN.sub(lambda m: named.get(m[0], m[0]), line))


def recordings(model: str) -> Recordings | None:
    """Return the recordings of the folder that a model's name gives, or None if it gives none."""
    folder = Path(model.removeprefix(REPLAY))
    return Recordings(folder) if model.startswith(REPLAY) and folder.is_dir() else None


@lru_cache
def _name(folder: Path) -> str:
    content = hashlib.sha256()
    for path in sorted(folder.glob("*.jsonl")):
        content.update(path.name.encode() + path.read_bytes())
    return f"{REPLAY}{folder.resolve().name}#{content.hexdigest()[:12]}"
