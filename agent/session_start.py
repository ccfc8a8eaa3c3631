"""What a session's log begins with: who decides, within which limits and policy, on which picture.

Whoever goes on with a session works by it, so that it is checked before anything follows from it.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pydantic import ConfigDict, ValidationError
from pydantic_core import to_json

from ..tools.errors import InputError, StorageError
from ..tools.formation.value import Value
from ..tools.tool import violations
from ..tools.world import PictureFacts
from .limits import Limits
from .policy import Decision
from .store.folder import read_events
from .store.protocol import Event, StoredSession

FORMAT = "formup-session-1"


class _Part(Value):
    model_config = ConfigDict(strict=True)


class _PromptFacts(_Part):
    id: str
    version: int | str
    sha256: str
    file_sha256: str


class _StoredPicture(_Part):
    facts: PictureFacts
    name: str
    path: str | None
    file: str


class _Start(_Part):
    format: Literal["formup-session-1"]
    model: str
    planner: str | None
    base_url: str | None
    library: str | None
    prompt: _PromptFacts | None
    prompts: tuple[_PromptFacts, ...]
    limits: Limits
    policy: tuple[tuple[str, Decision], ...]
    picture: _StoredPicture


def read_session(source: Path | StoredSession) -> Sequence[Event]:
    """The events of a session, of which the first is as formup writes it.

    Args:
        source: a log, a folder with one, or a session in a store.

    Raises:
        StorageError: missing, unreadable, or no log of a session.
    """
    events = read_events(source) if isinstance(source, Path) else source.events()
    label = source if isinstance(source, Path) else source.label
    problem = f"it is of type {events[0].kind!r}, not 'session'."
    if events[0].kind == "session":
        try:
            _Start.model_validate_json(to_json(events[0].data), strict=True)
            return events
        except (ValidationError, InputError) as error:
            problem = violations(error) if isinstance(error, ValidationError) else str(error)
    raise StorageError(f"{label} does not begin with a line that formup wrote: {problem}")
