"""Copies of sessions: forks at a turn, which leave the original as it is."""

from collections.abc import Sequence

from ...tools.errors import InputError
from .protocol import Event, Store, StoredSession, files_named, owner_of


def fork(
    store: Store, source: StoredSession, turn: int | None = None, name: str = ""
) -> StoredSession:
    """Create a session that begins with the turns of another.

    Args:
        store: where it is created.
        source: the session to copy, which is not written to.
        turn: the last turn to copy, from 1; None for all.
        name: what a person calls the new session.

    Raises:
        InputError: there is no such turn, or a session cannot be read or written.
    """
    events = source.events()
    events = events if turn is None else up_to_turn(events, turn)
    return store.create(name, events, files_named(events, source.artefacts), owner_of(source.id))


def up_to_turn(events: Sequence[Event], turn: int) -> tuple[Event, ...]:
    """Return the events up to the end of a turn, counted from 1.

    Raises:
        InputError: there is no such turn.
    """
    starts = [place for place, event in enumerate(events) if event.kind == "turn"]
    if not 1 <= turn <= len(starts):
        raise InputError(f"There is no turn {turn}; the session has turns 1 to {len(starts)}.")
    return tuple(events[: [*starts, len(events)][turn]])
