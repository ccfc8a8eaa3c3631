"""Writes recordings anew after texts or tools have changed: the replies stay, the results are new.

python renew.py RECORDINGS FOLDER: gives the replies of every RECORDINGS/*.jsonl again, whatever is
said to them, and keeps the new recordings in FOLDER, without the worlds. It prints how each ended
before and now: replies that no longer fit have to be given anew by somebody who looks.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from formup.agent.agent import Agent
from formup.agent.store.folder import read_events
from formup.agent.store.protocol import Event
from formup.evals.experiments.dialogue_work import hold
from formup.evals.experiments.pointing import pointing
from formup.evals.experiments.recordings import PLAN, RecordedReplies
from formup.evals.tasks.suites import load_suite
from formup.tools.context import Settings
from formup.tools.perception.image import load_picture

DRAWN = Path(__file__).parent / "injected" / "images"
TASKS = {t.id: t for name in ("photos", "many", "dialogues") for t in load_suite(name).tasks}


def renewed(path: Path, written: Path) -> tuple[Event, ...]:
    """The run of a recording once more, written to a file."""
    turn = next(event.data for event in read_events(path) if event.kind == "turn")
    task = TASKS.get(path.stem)
    image = None if task is None else task.picture
    picture = load_picture(image if isinstance(image, Path) else DRAWN / f"{path.stem}.png")
    settings = Settings.model_validate(turn["settings"])
    if task is not None and task.dialogue is not None:
        hold(
            Agent(RecordedReplies(path)),
            picture,
            task,
            settings,
            pointing(task, "words", 0),
            written,
        )
    else:
        Agent(RecordedReplies(path)).run(picture, turn["words"], settings=settings, trace=written)
    return read_events(written)


def ended(events: Sequence[Event]) -> list[tuple[str, str]]:
    """How the turns of a recording end: status and message."""
    ends = [event.data for event in events if event.kind == "end"]
    return [(end["status"], PLAN.sub("p-...", end["message"])) for end in ends]


def recording(before: Sequence[Event], now: Sequence[Event]) -> str:
    """The lines of a new recording, by whom the one before is; no paths of this machine in it."""
    facts = {k: before[0].data[k] for k in ("model", "planner", "prompt", "prompts")}
    kept: list[dict[str, Any]] = [
        {"type": event.kind, "seconds": event.seconds, **event.data}
        for event in now
        if event.kind != "world"
    ]
    kept[0] |= facts
    kept[0]["picture"] = kept[0]["picture"] | {"path": None}
    lines = [json.dumps({"n": n, **line}, ensure_ascii=False) for n, line in enumerate(kept, 1)]
    return "\n".join([*lines, ""])


def main() -> None:
    """All of a folder."""
    source, goal = (Path(name) for name in sys.argv[1:])
    goal.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        for path in sorted(source.glob("*.jsonl")):
            before = read_events(path)
            now = renewed(path, Path(scratch) / path.name)
            then, ends = ended(before), ended(now)
            print(path.stem, "same" if then == ends else f"{then} -> {ends}")  # noqa: T201
            (goal / path.name).write_text(recording(before, now), "utf-8")


if __name__ == "__main__":
    main()
