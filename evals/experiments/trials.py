"""A trial and its result: the key that names it, its seed, its line in trials.jsonl.

Everything a result depends on is in the key: a changed prompt, suite or tool schema makes other
trials. Infrastructure errors (such as a provider that is down) are no failures: never scored.
"""

import hashlib
import json
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

Sha = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Name = Annotated[str, Field(min_length=1)]
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Amount = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Status = Literal["pass", "fail", "model_invalid", "infra_error"]
USUAL = "edges"
"""The default descriptor, which is left out of names."""
USUAL_SEGMENTER = "grabcut"
"""The default for what cuts things out, which needs no weights."""
UNEQUAL = frozenset({"seconds", "host", "files", "after", "seal"})
"""Fields that differ from run to run of the same trial: times, and hashes of what has times."""


class Arm(BaseModel):
    """What is compared: a method with all that its results depend on.

    Attributes:
        method: who decides, such as agent or alone.
        prompt: id@vNNN; None for rules, which read none.
        sha256: of the prompt's text.
        tools: SHA-256 of the schemas of the tools offered.
        model: provider:name, or offline.
        descriptor: how shapes are put into words, such as edges; None if none are.
        mode: how things are pointed at; words if they are not.
        segmenter: what cuts things out; None for the usual one.
        frame: the one in which coordinates were written; None for pixels.
        without: the part of the tools that was left out; None for the whole.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    method: Name
    prompt: Name | None = None
    sha256: Sha | None = None
    tools: Sha | None = None
    model: Name
    descriptor: Name | None = None
    mode: Name = "words"
    segmenter: Name | None = None
    frame: Name | None = None
    without: Name | None = None

    @property
    def name(self) -> str:
        """Method, prompt with the beginning of its hash, model; other fields only if unusual."""
        prompt = f" {self.prompt}#{(self.sha256 or '')[:12]}" if self.prompt else ""
        shapes = f" {self.descriptor}" if self.descriptor not in (None, USUAL) else ""
        mode = "" if self.mode == "words" else f" {self.mode}"
        less = self.without and f"without {self.without}"
        more = "".join(f" {said}" for said in (self.segmenter, self.frame, less) if said)
        return f"{self.method}{prompt} {self.model}{shapes}{mode}{more}"


class Trial(BaseModel):
    """One try of one task by one arm of a sweep.

    Attributes:
        suite: SHA-256 of the suite of tasks.
        trial: number of the try, from 0.
        category, setup, style: of the task, such as caging, hidden, fresh; results are also shown
            by each.
        must_pass: whether the task is one that always succeeds.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    suite: Sha
    task: Name
    trial: Count
    arm: Arm
    category: str = ""
    setup: str = ""
    style: str = ""
    must_pass: bool = False

    @cached_property
    def key(self) -> str:
        """SHA-256 of all fields."""
        return hashlib.sha256(canonical(self.model_dump(include=_FIELDS))).hexdigest()

    @cached_property
    def seed(self) -> int:
        """Seed of all randomness in the trial, 63 bits; equal in every arm, to pair their luck."""
        named = canonical([self.suite, self.task, self.trial])
        return int.from_bytes(hashlib.sha256(named).digest()[:8], "big") >> 1

    @property
    def order(self) -> tuple[Any, ...]:
        """Sort key by task, trial, then arm: the order of compared results."""
        return (self.task, self.trial, self.arm.name, self.key)


_FIELDS = set(Trial.model_fields)


class Turns(BaseModel):
    """The turns of a dialogue, counted.

    Attributes:
        right: turns in which all was right.
        still: those that were to change nothing; `kept` of them did so.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    total: Count
    right: Count
    still: Count
    kept: Count


class TrialRow(Trial):
    """A trial with its result.

    Attributes:
        outcome: status the run ended with, such as deployed or question.
        sr: success; None for an infrastructure error, as are gcr and strict.
        gcr: goal conditions recall, the share of robots that stand right.
        strict: success at the tighter tolerances.
        object_correct: whether it was about the right thing; None if that was not graded.
        iou: overlap of the best outline measured with the true one; None if none was.
        e95: how near 95 % of its boundary and of the true one lie, see `grading.grades`.
        feedback: what was wrong, in a sentence.
        cached_tokens: input in tokens of full price, with the prompt and the tools in the cache.
        turns: of a dialogue, whose gcr is the share of them that were right; else None.
        files: hash of what is stored of it in attempts/; None if nothing is.
        after, seal: see seals.py; empty until it is written.
    """

    status: Status
    outcome: str = ""
    sr: bool | None = None
    gcr: Share | None = None
    strict: bool | None = None
    object_correct: bool | None = None
    iou: Share | None = None
    e95: Share | None = None
    feedback: str = ""
    requests: Count = 0
    input_tokens: Count = 0
    cached_tokens: Count = 0
    output_tokens: Count = 0
    cost_usd: Amount = 0.0
    seconds: Amount = 0.0
    host: str = ""
    turns: Turns | None = None
    files: Sha | None = None
    after: str = ""
    seal: str = ""

    @classmethod
    def of(cls, trial: Trial, status: Status, **facts: Any) -> Self:
        """Make the row of a trial; `sr` follows from the status."""
        success = None if status == "infra_error" else status == "pass"
        return cls(**trial.model_dump(include=_FIELDS), status=status, sr=success, **facts)

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        if not self.scored and (self.sr, self.gcr, self.strict) != (None, None, None):
            raise ValueError("an infrastructure error is not scored")
        if self.scored and self.sr != (self.status == "pass"):
            raise ValueError("sr must be true for the status pass and false for any other")
        if self.strict and not self.sr:
            raise ValueError("strict success is success")
        return self

    @property
    def scored(self) -> bool:
        """Whether it says anything about the arm."""
        return self.status != "infra_error"

    @property
    def placed(self) -> bool:
        """Whether robots stand where they were sent."""
        return self.outcome == "deployed"

    @property
    def line(self) -> bytes:
        """The row as it is written: one line of JSON, keys sorted, ASCII."""
        return canonical(self.model_dump()) + b"\n"

    @property
    def equal_line(self) -> bytes:
        """The line without `UNEQUAL` fields such as times: the same however it was run."""
        return canonical(self.model_dump(exclude=set(UNEQUAL))) + b"\n"


def canonical(value: object) -> bytes:
    """Return JSON that is equal for equal values."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
