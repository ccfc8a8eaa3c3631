"""Sessions for others to read: a page with pictures, JSON, or the folder that `formup trace` reads.

All of it comes from the events, none of which holds a key.
"""

import io
import json
import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from ..tools.draw import draw_plan
from ..tools.errors import StorageError
from ..tools.perception.image import Picture
from ..tools.store import write_whole
from ..tools.world import World
from ..tools.world_changes import with_changes
from .session import load_run, model_name, stored_picture
from .session_start import read_session
from .store.folder import PICTURES, log_path, suffix_of
from .store.folder_store import write_session
from .store.protocol import Event, StoredSession, files_named

PAGE, EVENTS = "session.md", "session.json"
FORMAT = "formup-export-1"


def export_folder(session: StoredSession, folder: Path) -> Path:
    """Write a session as a run folder and return the path of its log.

    Raises:
        StorageError: there is a session already, or it cannot be read or written.
    """
    events = read_session(session)
    _not_there(log_path(_existing(folder)))
    write_session(folder, events, files_named(events, session.artefacts))
    return log_path(folder)


def export_json(session: StoredSession, folder: Path) -> Path:
    """Write all events of a session as one JSON object and return its path.

    Pictures are named by their hash.

    Raises:
        StorageError: there is a file already, or it cannot be read or written.
    """
    lines = [
        {"n": e.number, "type": e.kind, "seconds": e.seconds, **e.data}
        for e in read_session(session)
    ]
    content = {"format": FORMAT, "session": session.id, "events": lines}
    path = _not_there(_existing(folder) / EVENTS)
    write_whole(path, json.dumps(content, indent=1, ensure_ascii=False).encode())
    return path


def export_page(session: StoredSession, folder: Path) -> Path:
    """Write what was said and what came of it as Markdown and return the page's path.

    There is a picture of each new plan.

    Raises:
        StorageError: there is a page already, or it cannot be read or written.
        InputError: the picture is missing.
    """
    start, *events = read_session(session)
    if events:
        picture = load_run(session).context.picture
    else:  # nothing was said yet
        picture = stored_picture(start.data["picture"], session.artefacts, None)
    path = _not_there(_existing(folder) / PAGE)
    (folder / PICTURES).mkdir(exist_ok=True)
    facts = picture.width, picture.height, model_name(start.data)
    lines = [f"# Session {session.id}", "", "{} x {} px, {}".format(*facts), ""]
    data = session.artefacts.get(start.data["picture"]["file"])
    lines += _picture_lines(folder, "start", data)
    world = World.of(picture)
    for number, turn in enumerate(_by_turns(events), start=1):
        began, world = world, _after(world, turn)
        lines += [f"## {number}. {_escaped(turn[0].data['words'])}", "", *_asked_and_answered(turn)]
        if world.current is not None and world.current != began.current:
            lines += _picture_lines(
                folder, world.current, _plan_png(picture, world, turn[0].data["words"])
            )
        lines += [_escaped(_came_to(turn)), ""]
    write_whole(path, "\n".join(lines).encode())
    return path


def _by_turns(events: Sequence[Event]) -> Iterator[Sequence[Event]]:
    starts = [place for place, event in enumerate(events) if event.kind == "turn"]
    for first, after in pairwise([*starts, len(events)]):
        yield events[first:after]


def _after(world: World, turn: Sequence[Event]) -> World:
    for event in turn:
        world = with_changes(world, event.data["changes"]) if event.kind == "world" else world
    return world


def _asked_and_answered(turn: Sequence[Event]) -> Iterator[str]:
    """Yield lines with the questions of a turn that were answered, and the answers."""
    messages = [event.data for event in turn if event.kind == "message"]
    calls = {c["id"]: c for m in messages for c in m.get("calls", ())}
    for message in messages:
        if message.get("name") == "ask_user" and not message.get("error"):
            question: Any = calls[message["call_id"]]["arguments"].get("question", "")
            yield f"> {_escaped(question)}\n>\n> **{_escaped(message['text'])}**"
            yield ""


def _came_to(turn: Sequence[Event]) -> str:
    ends = [event.data for event in turn if event.kind == "end"]
    return f"{ends[-1]['status']}: {ends[-1]['message']}" if ends else "This was broken off."


def _plan_png(picture: Picture, world: World, title: str) -> bytes:
    file = io.BytesIO()
    draw_plan(picture, world, world.plan().plan, title).save(file, "PNG")
    return file.getvalue()


def _picture_lines(folder: Path, name: str, data: bytes) -> list[str]:
    """Write a picture beside the page and return the lines that show it."""
    path = f"{PICTURES}/{name}.{suffix_of(data)}"
    write_whole(folder / path, data)
    return [f"![{name}]({path})", ""]


def _escaped(text: str) -> str:
    """Return a text as one line, with every character escaped that Markdown interprets."""
    return re.sub(r"([\\`*_{}\[\]<>#|&])", r"\\\1", " ".join(text.split()))


def _existing(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"{folder} cannot be made: {error.strerror}.") from None
    return folder


def _not_there(path: Path) -> Path:
    if path.exists():
        raise StorageError(f"{path} is there already and is not overwritten; name another folder.")
    return path
