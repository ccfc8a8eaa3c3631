"""`formup sessions`: lists, searches, shows, renames, forks, exports and deletes conversations."""

import json
from collections.abc import Generator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from textwrap import shorten
from typing import Annotated

import typer

from ..agent.export import export_folder, export_json, export_page
from ..agent.store.copies import fork as fork_of
from ..agent.store.places import store_at
from ..agent.store.protocol import SessionFacts, Store, StoredSession
from . import options as o
from .terminal import say
from .trace import show_events

LONGEST = 100
"""Most characters of a session's name and words in a list."""
app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

SessionId = Annotated[
    str, typer.Argument(metavar="ID", help="ID of a session, as formup sessions list shows it.")
]
SearchText = Annotated[str, typer.Argument(help="Text to look for, in names and in what was said.")]
NewName = Annotated[str, typer.Argument(help="New name of the session.")]
LastTurn = Annotated[
    int | None, typer.Option("--turn", help="Last turn to copy; default: all turns.")
]
ExportFolder = Annotated[
    Path, typer.Argument(help="Folder to write to; it must not hold a session yet.")
]


@app.command("list")
def list_sessions(store: o.StoreUrl = None, as_json: o.Json = False) -> None:
    """List the stored sessions, newest first."""
    _list(store, "", as_json)


@app.command()
def search(text: SearchText, store: o.StoreUrl = None, as_json: o.Json = False) -> None:
    """List the sessions whose name or conversation contains a text."""
    _list(store, text, as_json)


@app.command()
def show(session: SessionId, store: o.StoreUrl = None) -> None:
    """Show a session step by step.

    Prints messages, tool calls, times, tokens and cost.
    """
    with _at(store) as there:
        events, how_on = (
            there.open(session).events(),
            f"continue with formup chat --session {session}",
        )
    show_events(events, lambda sha256: sha256[:16], session, how_on)


@app.command()
def rename(session: SessionId, name: NewName, store: o.StoreUrl = None) -> None:
    """Rename a session."""
    with _at(store) as there:
        there.rename(session, name)


@app.command()
def fork(session: SessionId, turn: LastTurn = None, store: o.StoreUrl = None) -> None:
    """Copy a session up to a turn into a new one, and print its ID.

    The session itself stays as it is.
    """
    with _at(store) as there:
        say(fork_of(there, there.open(session), turn).id)


@app.command(name="export")
def export_session(session: SessionId, folder: ExportFolder, store: o.StoreUrl = None) -> None:
    """Export a session to a folder.

    Writes a page with pictures, all events as JSON, and the files that formup trace reads.
    """
    with _at(store) as there:
        say(export(there.open(session), folder))


@app.command()
def delete(session: SessionId, store: o.StoreUrl = None) -> None:
    """Delete a session and its files; this cannot be undone."""
    with _at(store) as there:
        there.delete(session)


def export(session: StoredSession, folder: Path) -> str:
    """Export a session in every format, and return a sentence that says where it is.

    Raises:
        StorageError: the folder has a session already, or one of them cannot be read or written.
    """
    export_folder(session, folder)
    written = (export_page(session, folder), export_json(session, folder))
    page, events = (path.name for path in written)
    return f"Exported to {folder}: {page} to read, {events}, and the files that formup trace reads."


def list_words(found: Sequence[SessionFacts]) -> str:
    """Return sessions as text, one per line."""
    lines: list[str] = []
    for facts in found:
        when = datetime.fromisoformat(facts.created).astimezone().strftime("%Y-%m-%d %H:%M")
        noun = "turn" if facts.turns == 1 else "turns"
        said = ": ".join(text for text in (facts.name, " ".join(facts.words.split())) if text)
        lines.append(f"{facts.id}  {when}  {facts.turns} {noun}  {shorten(said, LONGEST)}")
    return "\n".join(lines) or "There are no sessions."


def _list(store: str | None, text: str, as_json: bool) -> None:
    with _at(store) as there:
        found = there.sessions(text)
    if as_json:
        say(json.dumps([asdict(facts) for facts in found], indent=2))
    else:
        say(list_words(found))


@contextmanager
def _at(url: str | None) -> Generator[Store, None, None]:
    with closing(store_at(url)) as store:
        yield store
