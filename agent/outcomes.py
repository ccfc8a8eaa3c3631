"""How a turn ends, also at a limit: four types, each with all messages and the world."""

from dataclasses import dataclass
from typing import Literal

from ..tools.world import World
from .messages import Call, History

StopKind = Literal["limit", "repeat", "model", "tool", "fleet"]
"""limit: a limit of the turn was reached; repeat: the same call had the same answer over and over;
model, tool, fleet: it failed."""


@dataclass(frozen=True)
class Answered:
    """The model has finished; `text` is its last word."""

    messages: History
    world: World
    text: str


@dataclass(frozen=True)
class Paused:
    """A person must answer `call`: a question, or leave to move robots to the plan `plan_id`."""

    messages: History
    world: World
    call: Call
    plan_id: str | None = None


@dataclass(frozen=True)
class Stopped:
    """Ended early; `reason` is one sentence, `error` what a broken tool raised."""

    messages: History
    world: World
    kind: StopKind
    reason: str
    error: BaseException | None = None


@dataclass(frozen=True)
class Cancelled:
    """Interrupted from outside."""

    messages: History
    world: World


Outcome = Answered | Paused | Stopped | Cancelled
