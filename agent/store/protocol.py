"""What a conversation is stored in: an append-only log of numbered events.

State is folded from the events, so that undo, crashes and replays follow from the log alone. Files
that events name by their hash lie beside it, as `Artefacts`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol

EventKind = Literal["session", "turn", "resume", "world", "message", "approval", "moving", "end"]
"""session: who decides, by which prompts, within which limits, and the picture; turn: what the
person says, with the settings; resume: the turn goes on, perhaps in another process; world: what
has changed in it; message: of the conversation; approval: a person's yes or no to a call; moving:
robots are about to move; end: how the turn ended."""


@dataclass(frozen=True)
class Event:
    """One thing that happened.

    Attributes:
        number: from 1, without gaps.
        seconds: since the turn was begun or resumed.
        data: JSON.
    """

    number: int
    kind: EventKind
    seconds: float
    data: Mapping[str, Any]


class EventLog(Protocol):
    """The events of one session; whoever has it open for writing is the only one."""

    @property
    def last(self) -> int:
        """The number of the last event; 0 where there is none."""
        ...

    def append(self, kind: EventKind, data: Mapping[str, Any]) -> int:
        """Write one event, at once and whole, and return its number.

        Raises:
            StorageError: it cannot be written.
        """
        ...

    def events(self, after: int = 0) -> tuple[Event, ...]:
        """The events with greater numbers than that, in order."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...
