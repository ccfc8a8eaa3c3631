"""The JSON that the server's own API takes and gives."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ...agent.approvals import Waiting
from ...agent.report import Report
from ...agent.session import Run
from ...tools.formation.editing.edit_kinds import Edit
from ...tools.perception.target_prompt import TargetPrompt
from .tokens import Scope

Key = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[\x21-\x7e]+$")]
Words = Annotated[str, Field(min_length=1, max_length=20_000)]
Pointed = Annotated[tuple[TargetPrompt, ...], Field(max_length=100)]


class Form(BaseModel):
    """JSON from a client; unknown fields are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Message(Form):
    """A message from a person, with the things they point at."""

    words: Words
    pointed: Pointed = ()
    keep_out: Pointed = ()


class Edits(Form):
    """Edits in the format of the tool `edit_formation`, applied in order."""

    edits: Annotated[tuple[dict[str, Any], ...], Field(min_length=1, max_length=20)]


class Preview(Form):
    """Edits to try on a plan, by default the current one."""

    edits: Annotated[tuple[Edit, ...], Field(min_length=1, max_length=20)]
    plan_id: Annotated[str | None, Field(max_length=100)] = None


class Pointing(Form):
    """A thing that a person points at."""

    prompt: TargetPrompt


class Undo(Form):
    """Steps to go back, or forward if negative; or the id of the plan to go back to, or `first`."""

    steps: Annotated[int, Field(ge=-1000, le=1000)] = 1
    to: Annotated[str | None, Field(max_length=100)] = None


class Deployment(Form):
    """The plan to move the robots to."""

    plan_id: Annotated[str, Field(min_length=1, max_length=100)]


class Approval(Form):
    """Approval of exactly the plan that waits, with the nonce from `waits`."""

    plan_id: Annotated[str, Field(min_length=1, max_length=100)]
    nonce: Annotated[str, Field(min_length=1, max_length=100)]


class Fork(Form):
    """Number of turns to copy; all by default."""

    turn: Annotated[int | None, Field(ge=1, le=1_000_000)] = None


class Name(Form):
    """The new name of a session."""

    name: Annotated[str, Field(max_length=200)]


class Waits(BaseModel):
    """What waits for a person's approval, and the nonce that the approval must contain."""

    plan_id: str | None
    nonce: str
    message: str

    @classmethod
    def of(cls, waiting: Waiting | None) -> "Waits | None":
        """Return the form of what the service says is waiting; None if nothing is."""
        if waiting is None:
            return None
        return cls(plan_id=waiting.plan_id, nonce=waiting.nonce, message=waiting.message)


class TurnState(BaseModel):
    """A turn, running or finished.

    Attributes:
        turn: the number of the event that began it; 0 if nothing has begun.
        status: as in the report; or `running`; or `interrupted`, if its process ended first.
        report: only for the session's last turn.
    """

    turn: int
    status: str
    message: str = ""
    words: str = ""
    by: str = ""
    moving: bool = False
    report: Report | None = None

    @classmethod
    def of(cls, run: Run, number: int, by: str = "") -> "TurnState":
        """Return the state of a turn that is over."""
        report = run.report
        return cls(
            turn=number,
            status=report.status,
            message=report.message,
            words=run.context.words,
            by=by,
            report=report,
        )


class Outlined(BaseModel):
    """The outline of a thing, as a turn would measure it.

    Attributes:
        rings: the closed boundaries of the thing and of its holes, px.
        confidence: from 0 to 1; `sound` if it reaches `threshold`.
        doubtful: whether a person should check it before robots are sent there.
    """

    id: str
    label: str
    rings: list[list[list[float]]]
    confidence: float
    threshold: float
    sound: bool
    doubtful: bool


class Shared(BaseModel):
    """A code that gives others read-only access to a session."""

    code: str


class SessionFacts(BaseModel):
    """A session in a list."""

    id: str
    name: str
    created: str
    turns: int
    words: str
    picture: str | None


class SessionState(BaseModel):
    """The current state of a session.

    Attributes:
        scope: of the token that asks.
        events: the number of its last event, after which an event stream can continue.
        under_way: the turn that is running in this process.
        last: the report of the last turn.
        waits: what waits for an approval.
        plans: ids of all plans, oldest first; changes apply to `current`.
    """

    id: str
    agent: str
    scope: Scope
    events: int
    under_way: TurnState | None
    last: Report | None
    waits: Waits | None
    plans: tuple[str, ...]
    current: str | None


class AgentFacts(BaseModel):
    """An agent that can decide in sessions, and its model."""

    name: str
    model: str


class ErrorFacts(BaseModel):
    """What went wrong."""

    message: str
    type: Literal["invalid_request_error", "server_error"]
    param: str | None
    code: str | None


class Error(BaseModel):
    """The body of every error response."""

    error: ErrorFacts
