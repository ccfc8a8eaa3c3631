"""Writes recordings anew after texts or tools have changed: the replies stay, the results are new.

python renew.py TRACES FOLDER: gives the replies of every TRACES/*.jsonl again, whatever is said to
them, and keeps the new recordings in FOLDER, without the states of workspaces. It prints how each
ended before and now: replies that no longer fit have to be given anew by somebody who looks.
"""

import json
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from formup.agent.agent import Agent
from formup.agent.messages import Reply
from formup.agent.model import Request
from formup.agent.store.folder import Trace, read_trace
from formup.agent.wrappers.replay import ReplayModel
from formup.evals.tasks.suites import load_suite
from formup.tools.errors import ModelError
from formup.tools.perception.image import load_picture
from formup.tools.world import Settings

DRAWN = Path(__file__).parent / "injected" / "images"
TASKS = {t.id: t for name in ("photos", "many") for t in load_suite(name).tasks}


PLAN = re.compile(r"p-[0-9a-f]{10}")


class Spoken(ReplayModel):
    """The recorded replies in turn, whatever is said in between; plans go by their new ids."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._said = read_trace(path).of_type("message")

    async def reply(self, request: Request) -> Reply:
        """The next one.

        Raises:
            ModelError: there is none.
        """
        count = len(request.messages)
        if count >= len(self._said) or self._said[count]["role"] != "assistant":
            raise ModelError("The recorded replies fit no more.")
        named = {
            old: new
            for then, now in zip(self._said, request.messages, strict=False)
            for old, new in zip(PLAN.findall(then["text"]), PLAN.findall(now.text), strict=False)
        }
        line = json.dumps({k: v for k, v in self._said[count].items() if k in Reply.model_fields})
        return Reply.model_validate_json(PLAN.sub(lambda m: named.get(m[0], m[0]), line))


def renewed(path: Path, written: Path) -> Trace:
    """The run of a recording once more, written to a file."""
    start = read_trace(path).start
    facts = {k: start["settings"][k] for k in ("robots", "descriptor", "may_deploy", "seed")}
    task = TASKS.get(path.stem)
    image = None if task is None else task.picture
    picture = load_picture(image if isinstance(image, Path) else DRAWN / f"{path.stem}.png")
    Agent(Spoken(path)).run(
        picture, start["instruction"], settings=Settings(**facts), trace=written
    )
    return read_trace(written)


def main() -> None:
    """All of a folder."""
    source, goal = (Path(name) for name in sys.argv[1:])
    goal.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as scratch:
        for path in sorted(source.glob("*.jsonl")):
            before, now = read_trace(path), renewed(path, Path(scratch) / path.name)
            ends = [str(trace.end and trace.end["message"]) for trace in (before, now)]
            print(path.stem, "same" if ends[0] == ends[1] else " -> ".join(ends))  # noqa: T201
            kept = [line for line in now.lines if line["type"] != "state"]
            kept[0]["base_url"] = None
            text = "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in kept)
            (goal / path.name).write_text(text, "utf-8")


if __name__ == "__main__":
    main()
