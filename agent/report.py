"""What a run came to, as one value: the object `formup run --json` prints."""

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from ..tools.fleet.deploy import Arrival
from ..tools.formation.contract import Contract
from ..tools.formation.verdict import Verdict
from ..tools.perception.attributes import Candidate
from ..tools.scene import Box, Target
from ..tools.store import rings

Status = Literal[
    "deployed", "planned", "needs_approval", "question", "impossible", "stopped", "failed"
]
EXIT_CODES: dict[Status, int] = {
    "deployed": 0,
    "planned": 0,
    "question": 3,
    "impossible": 3,
    "needs_approval": 3,
    "stopped": 4,
    "failed": 4,
}


class Totals(BaseModel):
    """What the run used."""

    model_config = ConfigDict(frozen=True)

    requests: int = 0
    tool_calls: int = 0
    input_tokens: int = 0
    output_tokens: int = 0
    cost_usd: float = 0.0
    seconds: float = 0.0


class Report(BaseModel):
    """Status, what was found, the contract, its certificate, and what was observed.

    Lengths are pixels of the picture as the user sees it (x right, y down); positions are in
    robot order over all groups. What does not apply is None.
    """

    model_config = ConfigDict(frozen=True)

    status: Status
    message: str
    instruction: str
    image: dict[str, Any] | None = None
    targets: tuple[dict[str, Any], ...] = ()
    candidates: tuple[dict[str, Any], ...] | None = None
    contract: Contract | None = None
    plan_id: str | None = None
    positions: tuple[tuple[float, float], ...] | None = None
    verdict: Verdict | None = None
    arrival: Arrival | None = None
    model: str
    prompt: dict[str, Any] | None = None
    usage: Totals = Totals()
    files: dict[str, str | None] | None = None

    @property
    def exit_code(self) -> int:
        """What `formup run` exits with."""
        return EXIT_CODES[self.status]


def target_data(target: Target) -> dict[str, Any]:
    """A target as the report shows it."""
    outline, holes = rings(target)
    return {
        "id": target.id,
        "label": target.label,
        "box": _box(target.box),
        "confidence": target.confidence,
        "parts": dict(target.parts),
        "outline": outline,
        "holes": holes,
    }


def target_choice(target: Target) -> dict[str, Any]:
    """A target as a question offers it."""
    return {"id": target.id, "label": target.label, "box": _box(target.box)}


def candidate_choice(candidate: Candidate) -> dict[str, Any]:
    """A candidate as a question offers it."""
    seen = candidate.attributes
    return {
        "id": candidate.id,
        "label": candidate.label,
        "box": _box(candidate.outline.bounds),
        "colour": seen.colour,
        "shape": seen.shape,
        "area_px": round(seen.area),
    }


def _box(box: Box) -> list[float]:
    return [round(v, 1) for v in box]
