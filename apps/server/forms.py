"""The JSON that the server's own API takes and gives."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ...agent.approvals import Waiting
from ...agent.report import Report
from ...agent.session import Run
from ...tools.formation.editing.edit_kinds import Edit
from ...tools.perception.target_prompt import TargetPrompt

Key = Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[\x21-\x7e]+$")]
Words = Annotated[str, Field(min_length=1, max_length=20_000)]
Pointed = Annotated[tuple[TargetPrompt, ...], Field(max_length=100)]


class Form(BaseModel):
    """JSON from a client; unknown fields are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Message(Form):
    """What a person says, and points at with it."""

    words: Words
    pointed: Pointed = ()
    keep_out: Pointed = ()


class Edits(Form):
    """Edits as the tool `edit_formation` takes them, done in order."""

    edits: Annotated[tuple[dict[str, Any], ...], Field(min_length=1, max_length=20)]


class Preview(Form):
    """Edits to try on a plan, the one that stands by default."""

    edits: Annotated[tuple[Edit, ...], Field(min_length=1, max_length=20)]
    plan_id: Annotated[str | None, Field(max_length=100)] = None


class Pointing(Form):
    """What a person points at."""

    prompt: TargetPrompt


class Undo(Form):
    """How many steps back, below 0 forward; or to which plan, or `first`."""

    steps: Annotated[int, Field(ge=-1000, le=1000)] = 1
    to: Annotated[str | None, Field(max_length=100)] = None


class Deployment(Form):
    """Which plan the robots are to move to."""

    plan_id: Annotated[str, Field(min_length=1, max_length=100)]


class Approval(Form):
    """A yes to exactly what waits, with the nonce that `waits` gave."""

    plan_id: Annotated[str, Field(min_length=1, max_length=100)]
    nonce: Annotated[str, Field(min_length=1, max_length=100)]


class Fork(Form):
    """After how many turns; all by default."""

    turn: Annotated[int | None, Field(ge=1, le=1_000_000)] = None


class Name(Form):
    """What a session is called."""

    name: Annotated[str, Field(max_length=200)]


class Waits(BaseModel):
    """What waits for a person's yes, and the nonce which that has to name."""

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
    """A turn: under way, or what came of it.

    Attributes:
        turn: number of the event that began it; 0 where none has yet.
        status: as in the report, or running, or interrupted: its process ended before it did.
        report: whole for the session's last turn.
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
            words=report.instruction,
            by=by,
            report=report,
        )


class Outlined(BaseModel):
    """An outline as it would be measured.

    Attributes:
        rings: around it and around its holes, closed, px.
        confidence: alpha; `sound` where it reaches `threshold`.
        doubtful: whether somebody should look at it before robots are sent there.
    """

    id: str
    label: str
    rings: list[list[list[float]]]
    confidence: float
    threshold: float
    sound: bool
    doubtful: bool


class Shared(BaseModel):
    """A code that lets others look at a session."""

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
    """A session as it stands.

    Attributes:
        events: the number of its last event; event streams go on from there.
        under_way: the turn that runs in this process.
        last: what came of the last turn.
        plans: ids of all plans, oldest first; `current` is what changes apply to.
    """

    id: str
    agent: str
    events: int
    under_way: TurnState | None
    last: Report | None
    waits: Waits | None
    plans: tuple[str, ...]
    current: str | None


class AgentFacts(BaseModel):
    """Who decides in a session."""

    name: str
    model: str


class ErrorFacts(BaseModel):
    """What was wrong."""

    message: str
    type: Literal["invalid_request_error", "server_error"]
    param: str | None
    code: str | None


class Error(BaseModel):
    """How every error is told."""

    error: ErrorFacts
