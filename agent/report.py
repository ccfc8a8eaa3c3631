"""What a run came to, as one value: the object `formup run --json` prints."""

import json
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from ..tools.fleet.deploy import Arrival
from ..tools.formation.checking.verdict import Verdict
from ..tools.formation.contract import Contract
from ..tools.formation.plan import Plan, Shortfall
from ..tools.formation.units import in_metres, with_metres
from ..tools.perception.referring.attributes import Candidate
from ..tools.scene import Box, Scene, Target
from ..tools.store import rings
from ..tools.world import Workspace
from .messages import History, Reply, Result
from .outcomes import Cancelled, Outcome, Paused, Stopped

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
    robot order over all groups. What does not apply is None; `metric` is the same in metres where
    the picture's scale is known, see `metric_data`.
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
    partial: Shortfall | None = None
    arrival: Arrival | None = None
    metric: dict[str, Any] | None = None
    model: str
    prompt: dict[str, Any] | None = None
    prompts: tuple[dict[str, Any], ...] = ()
    usage: Totals = Totals()
    files: dict[str, str | None] | None = None

    @property
    def exit_code(self) -> int:
        """What `formup run` exits with."""
        return EXIT_CODES[self.status]


METRIC_FRAME = "metres, x right, y down, 0, 0 is the centre of the picture's top left pixel"


def metric_data(scene: Scene, plan: Plan | None, arrival: Arrival | None) -> dict[str, Any] | None:
    """What a report says in metres; None where the scale is not known.

    Positions as planned and as observed, how far off each is, and the certificate's measures.
    """
    scale = scene.metres_per_pixel
    if scale is None:
        return None
    data: dict[str, Any] = {"metres_per_pixel": scale, "frame": METRIC_FRAME}
    if plan is not None:
        places = plan.formation.positions
        measures = with_metres(plan.verdict.measures, scale)
        data["positions"] = [[in_metres(v, scale) for v in place] for place in places]
        data["measures"] = {k: v for k, v in measures.items() if k.endswith("_m")}
    if arrival is not None:
        data["observed"] = [[in_metres(v, scale) for v in place] for place in arrival.observed]
        data["residual"] = [in_metres(v, scale) for v in arrival.residual_px]
    return data


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


def make_report(
    outcome: Outcome, workspace: Workspace, instruction: str, model: str, seconds: float
) -> Report:
    """What a run that ended so has come to, after so many seconds."""
    picture = workspace.scene.picture
    plan = _plan(outcome, workspace)
    arrival = workspace.arrivals.get(plan.id) if plan else None
    status, message = _status(outcome, workspace, plan)
    return Report(
        status=status,
        message=message,
        instruction=instruction,
        image={"sha256": picture.sha256, "width": picture.width, "height": picture.height},
        targets=tuple(target_data(t) for t in workspace.scene.targets),
        candidates=_candidates(outcome, workspace),
        contract=plan.formation.contract if plan else None,
        plan_id=plan.id if plan else None,
        positions=plan.formation.positions if plan else None,
        verdict=plan.verdict if plan else None,
        partial=plan.partial if plan else None,
        arrival=arrival,
        metric=metric_data(workspace.scene, plan, arrival),
        model=model,
        usage=_totals(outcome.messages, seconds),
    )


def _plan(outcome: Outcome, workspace: Workspace) -> Plan | None:
    """The plan deployed last, else the one a report names, else the last proposed; none void.

    A partial plan is shown only where it is named.
    """
    if workspace.arrivals:
        return workspace.plans[list(workspace.arrivals)[-1]]
    version, named = workspace.scene.version, _named(outcome.messages)
    valid = [p for p in workspace.plans.values() if p.formation.scene_version == version]
    whole = [p for p in valid if p.partial is None]
    meant = [p for p in valid if p.id == named] or whole
    return meant[-1] if meant else None


def _named(messages: History) -> str | None:
    """The plan that the report which closed the run names."""
    last = messages[-1] if messages else None  # none where a run was killed before its first
    if not isinstance(last, Result) or last.name != "report_impossible" or last.error:
        return None
    calls = [c for m in messages if isinstance(m, Reply) for c in m.calls]
    return next(c.arguments.get("plan_id") for c in calls if c.id == last.call_id)


def _status(outcome: Outcome, workspace: Workspace, plan: Plan | None) -> tuple[Status, str]:
    arrival = workspace.arrivals.get(plan.id) if plan else None
    if arrival is not None:  # robots have moved, whatever was said after that
        arrived = arrival.arrived and not isinstance(outcome, Stopped)
        return ("deployed" if arrived else "failed"), _last_words(outcome)
    if isinstance(outcome, Paused):
        asked = outcome.call.name == "ask_user"
        return ("question" if asked else "needs_approval"), _last_words(outcome)
    if isinstance(outcome, Stopped):
        ours = outcome.kind in ("limit", "repeat")
        return ("stopped" if ours else "failed"), outcome.reason
    if isinstance(outcome, Cancelled):
        return "stopped", _last_words(outcome)
    given_up = isinstance(outcome.messages[-1], Result)
    certified = plan is not None and plan.verdict.certified
    return ("planned" if certified and not given_up else "impossible"), _last_words(outcome)


def _last_words(outcome: Outcome) -> str:
    if isinstance(outcome, Paused):
        call = outcome.call
        if call.name == "ask_user":
            return str(call.arguments["question"])
        return f"A person must approve {call.name} of {json.dumps(call.arguments)}."
    if isinstance(outcome, Stopped):
        return outcome.reason
    if isinstance(outcome, Cancelled):
        return "The run was cancelled."
    return outcome.text


def _candidates(outcome: Outcome, workspace: Workspace) -> tuple[dict[str, object], ...] | None:
    """What a question offers, in its order; ids that mean nothing are left out."""
    if not (isinstance(outcome, Paused) and outcome.call.name == "ask_user"):
        return None
    named = outcome.call.arguments.get("candidates", ())
    known = {t.id: target_choice(t) for t in workspace.scene.targets}
    if any(n not in known for n in named):
        known |= {c.id: candidate_choice(c) for c in workspace.candidates()}
    return tuple(known[n] for n in named if n in known)


def _totals(messages: History, seconds: float) -> Totals:
    replies = [m for m in messages if isinstance(m, Reply)]
    return Totals(
        requests=len(replies),
        tool_calls=sum(len(m.calls) for m in replies),
        input_tokens=sum(m.usage.input_tokens for m in replies),
        output_tokens=sum(m.usage.output_tokens for m in replies),
        cost_usd=sum(m.usage.cost_usd for m in replies),
        seconds=round(seconds, 3),
    )


def _box(box: Box) -> list[float]:
    return [round(v, 1) for v in box]
