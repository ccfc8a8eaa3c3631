"""What a session's log begins with: who decides, within which limits and policy, on which picture.

A session that goes on relies on it, so it is checked before anything follows from it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import ConfigDict, ValidationError
from pydantic_core import to_json

from ..tools.context import Settings
from ..tools.errors import InputError, StorageError
from ..tools.formation.value import Value
from ..tools.perception.target_prompt import TargetPrompt
from ..tools.tool import violations
from ..tools.world import PictureFacts
from .limits import Limits
from .policy import Decision
from .store.folder import read_events
from .store.protocol import Event, StoredSession

if TYPE_CHECKING:
    from .agent import Agent

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


class Opening(Value):
    """What is fixed at the start of a session, for its first turn.

    Attributes:
        agent: name, in a service, of the agent that decides.
        settings: what the person fixed.
        pointed: the things meant, where the person points.
        keep_out: what no robot may enter.
    """

    agent: str = ""
    settings: Settings = Settings()
    pointed: tuple[TargetPrompt, ...] = ()
    keep_out: tuple[TargetPrompt, ...] = ()


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
    opening: dict[str, Any] | None = None


def start_facts(agent: "Agent", picture: Mapping[str, Any]) -> dict[str, Any]:
    """Return the first event's data for a session that an agent begins."""
    return {
        "format": FORMAT,
        "model": agent.names[0],
        "planner": agent.names[1],
        "base_url": agent.base_url,
        "library": agent.library.folder and str(agent.library.folder.absolute()),
        **prompt_facts(agent),
        "limits": asdict(agent.limits),
        "policy": agent.policy.rules,
        "picture": picture,
    }


def prompt_facts(agent: "Agent") -> dict[str, Any]:
    """Return the facts of the agent's prompt and, if two models share the work, of all theirs."""
    facts = tuple(p.facts for p in agent.prompts)
    mine = [f for f, p in zip(facts, agent.prompts, strict=True) if p == agent.prompt]
    return {"prompt": mine[0] if mine else None, "prompts": facts}


def read_session(source: Path | StoredSession) -> Sequence[Event]:
    """Return the events of a session, having checked that formup wrote the first.

    Args:
        source: a log, a folder with one, or a session in a store.

    Raises:
        StorageError: the source is missing, unreadable, or not the log of a session.
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
