"""Long sessions: the time to open, fork and append to one, and the tokens of its next request.

Turns are edits: a plan that moved a little, the call for it, its result, and the words of both.
"""

import asyncio
import json
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import to_json

from ..agent.agent import Agent
from ..agent.compaction import compacted
from ..agent.messages import Call, History, Message, Reply, Result, Usage, User
from ..agent.recording import LogRecorder, message_facts
from ..agent.session import Run, load_run
from ..agent.store.copies import fork, up_to_turn
from ..agent.store.folder_store import FolderStore
from ..agent.store.places import store_at
from ..agent.store.protocol import Event, EventKind, Store, files_named
from ..prompts import PromptLibrary
from ..tools.builtin import TOOLS
from ..tools.context import MemoryArtefacts, Settings
from ..tools.perception.image import Picture, picture_from_array
from ..tools.perception.target_prompt import TargetPrompt
from ..tools.world import PlanNode, World, to_json_values
from .growth import best, show

SIZES = (10, 300, 3_000)
ROBOTS = 30
BOX = TargetPrompt(id="t1", box=(700, 400, 1_000, 700))
"""The box in the picture of two megapixels."""


class Listed:
    """A log in memory."""

    def __init__(self, events: Sequence[Event]) -> None:
        self.written = list(events)

    @property
    def last(self) -> int:
        """See `EventLog.last`."""
        return len(self.written)

    def append(self, kind: EventKind, data: Mapping[str, Any]) -> int:
        """See `EventLog.append`."""
        self.written.append(Event(self.last + 1, kind, 0.01, data))
        return self.last

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """See `EventLog.events`."""
        return tuple(self.written[after:])

    def close(self) -> None:
        """See `EventLog.close`."""


def picture() -> Picture:
    """Return a picture of two megapixels, a red box on grey."""
    pixels = np.full((1_080, 1_920, 3), 90, np.uint8)
    pixels[410:690, 710:990] = (200, 40, 40)
    return picture_from_array(pixels)


def first_run(folder: Path) -> Run:
    """Return the run of a session of one turn, planned offline."""
    settings = Settings(robots=ROBOTS, may_deploy=False)
    stored = FolderStore(folder).create()
    return Agent().run(picture(), "Surround it", pointed=[BOX], settings=settings, trace=stored)


def long_session(turns: int, folder: Path) -> tuple[tuple[Event, ...], tuple[bytes, ...]]:
    """Return the events and files of a session of a number of turns."""
    first = first_run(folder)
    assert first.stored is not None and first.report.plan_id is not None
    log = Listed(first.stored.events())
    files = files_named(log.written, first.stored.artefacts)
    recorder = LogRecorder(log, MemoryArtefacts(), first.world, None)
    start = first.outcome.messages[0]
    assert isinstance(start, User)
    settings = to_json_values(first.context.settings)
    asyncio.run(record_turns(recorder, first.world, start.text, settings, turns))
    return tuple(log.written), files


async def record_turns(
    recorder: LogRecorder, world: World, start: str, settings: Any, turns: int
) -> None:
    """Record the turns after the first, up to number `turns`."""
    for number in range(2, turns + 1):
        words = f"A bit further out than in turn {number - 1}"
        await recorder.event("turn", {"words": words, "settings": settings})
        before, world = world, edited(world, number)
        for message in turn_messages(number, words, start, world):
            await recorder.message(message, before if isinstance(message, User) else world)
        await recorder.end(world, end_data(world))


def edited(world: World, number: int) -> World:
    """Return the world with one more plan, whose robots all stand a little further left."""
    node = world.plan()
    places = tuple((round(x - 0.001 * number, 3), y) for x, y in node.plan.formation.positions)
    formation = node.plan.formation.model_copy(update={"positions": places})
    plan = node.plan.model_copy(update={"formation": formation})
    return world.with_plan(PlanNode(plan=plan, parent=world.current, edit='[{"kind": "out"}]'))


def turn_messages(number: int, words: str, start: str, world: World) -> Iterator[Message]:
    """Yield the messages of a turn that makes an edit."""
    standing = {
        "plan": world.current,
        "contract": world.plan().plan.formation.contract.model_dump(
            mode="json", exclude_defaults=True
        ),
        "robots": [str(i + 1) for i in range(ROBOTS)],
        "deployed": False,
        "last": {"words": words, "edits": [{"kind": "out", "factor": 1.25}]},
        "things": [{"id": "t1", "label": "the red box"}],
        "steps": number,
        "redo": 0,
        "hold": False,
    }
    lines = [line for line in start.split("\n") if not line.startswith("Instruction")]
    asked = [f"Instruction: {json.dumps(words)}", *lines, f"Standing: {json.dumps(standing)}"]
    yield User(text="\n".join(asked))
    call = Call(id=f"call-{number}", name="edit_formation", arguments={"edits": [{"kind": "out"}]})
    yield Reply(calls=(call,), usage=Usage(input_tokens=4_000, output_tokens=60))
    moved = [{"robot": str(i + 1), "by_px": 12.5} for i in range(ROBOTS)]
    data = {"plan_id": world.current, "certified": True, "findings": [], "moves": moved}
    facts = {"plan_id": world.current}
    yield Result(call_id=call.id, name=call.name, text=json.dumps(data), facts=facts)
    yield Reply(text=f"All {ROBOTS} robots stand 12.5 px further out (plan {world.current}).")


def end_data(world: World) -> dict[str, Any]:
    """Return the data of the event that ends a turn."""
    usage = {"requests": 2, "tool_calls": 1, "input_tokens": 8_000, "output_tokens": 90}
    return {
        "outcome": "answered",
        "status": "planned",
        "message": f"All stand further out (plan {world.current}).",
        "usage": {**usage, "cost_usd": 0.01, "seconds": 2.0},
    }


def next_request(history: History, number: int) -> int:
    """Return the tokens of a turn's first request: prompt, tools and the compacted history."""
    turns = [i for i, message in enumerate(history) if isinstance(message, User)]
    asked = history[: turns[number - 1] + 1]
    tools = [[t.name, t.description, t.schema] for t in TOOLS]
    prompt = PromptLibrary().load("former").render() + json.dumps(tools)
    return tokens((User(text=prompt), *compacted(asked)))


def tokens(history: History) -> int:
    """Return roughly the tokens of messages, at four characters each, pictures aside.

    `formup prompts` counts them the same way.
    """
    return (
        sum(len(m.text) + len(json.dumps(message_facts(m).get("calls", ()))) for m in history) // 4
    )


def rows() -> Iterator[str]:
    """Yield times to open, fork and append to sessions by length, then the tokens of requests."""
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        events, files = long_session(max(SIZES), home / "begun")
        stores = store_at(f"sqlite:///{home / 'bench.db'}"), store_at(home / "folders")
        yield f"{'turns':>8} {'events':>8} {'MB':>7} {'SQLite ms':>12} {'folder':>12} {'fork':>8}"
        for turns in SIZES:
            yield size_row(stores, up_to_turn(events, turns), files, turns)
        yield "opening: by the clock, and of that CPU"
        yield from appending(stores)
        stored = stores[0].create("weights", events, files)
        yield from weights(load_run(stored).outcome.messages)


def size_row(
    stores: Sequence[Store], events: Sequence[Event], files: Sequence[bytes], turns: int
) -> str:
    """Return a row: how long a session of a number of turns takes to open and to fork, ms."""
    stored = [store.create("bench", events, files) for store in stores]
    size = sum(len(to_json(dict(event.data))) for event in events) / 1e6
    opened = " ".join(
        f"{wall(lambda s=s: load_run(s)):6.0f} {best(lambda s=s: load_run(s), 3):5.0f}"
        for s in stored
    )
    forked = wall(lambda: fork(stores[0], stored[0], turns), 2)
    return f"{turns:8,} {len(events):8,} {size:7.2f} {opened} {forked:8.0f}"


def wall(work: Callable[[], object], repeats: int = 5) -> float:
    """Return the least wall time over the repeats, ms."""
    times: list[float] = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(1000 * (time.perf_counter() - began))
    return min(times)


def appending(stores: Sequence[Store]) -> Iterator[str]:
    """Yield the milliseconds that appending one event takes in each store."""
    for store in stores:
        log = store.create("appending").write(0)
        spent = wall(lambda log=log: log.append("message", {"text": "x" * 500}), 200)
        log.close()
        yield f"one event in {type(store).__name__:18} {spent:8.2f} ms"


def weights(history: History) -> Iterator[str]:
    """Yield the tokens of requests throughout a conversation, and their ratio to the tenth."""
    tenth = next_request(history, 10)
    yield f"{'request':>8} {'tokens':>8} {'/ 10th':>7}"
    for number in (1, 10, 100, 301, 303, 3_000):
        weight = next_request(history, number)
        yield f"{number:8,} {weight:8,} {weight / tenth:7.2f}"


if __name__ == "__main__":
    show(rows())
