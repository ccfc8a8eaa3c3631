"""How a run ends: four types, each with every message there was. A limit is one of them."""

from dataclasses import dataclass
from typing import Literal

from .messages import Call, History

StopKind = Literal["limit", "repeat", "model", "tool", "fleet"]
"""limit: a bound of this run; repeat: the same call with the same answer, twice if it failed, three
times if not; model, tool, fleet: they failed."""


@dataclass(frozen=True)
class Answered:
    """The model has finished; `text` is its last word."""

    messages: History
    text: str


@dataclass(frozen=True)
class Paused:
    """A person must answer `call`: a question, or leave to move robots. Run again to go on."""

    messages: History
    call: Call


@dataclass(frozen=True)
class Stopped:
    """Ended early; `reason` is one sentence, `error` what a broken tool raised."""

    messages: History
    kind: StopKind
    reason: str
    error: BaseException | None = None


@dataclass(frozen=True)
class Cancelled:
    """Interrupted from outside."""

    messages: History


Outcome = Answered | Paused | Stopped | Cancelled
