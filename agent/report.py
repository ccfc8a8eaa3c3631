"""The result of a run as one value: the object that `formup run --json` prints."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from ..tools.context import Context
from ..tools.fleet.arrival import Arrival
from ..tools.fleet.follow import Follow
from ..tools.formation.checking.verdict import Verdict
from ..tools.formation.contract import Contract
from ..tools.formation.encounters import notes_of
from ..tools.formation.plan import Plan, Shortfall
from ..tools.formation.units import in_metres, length_text, with_metres
from ..tools.motion.checking import MotionVerdict
from ..tools.outline_field import rounded_rings
from ..tools.perception.referring.attributes import Candidate
from ..tools.perception.target_prompt import Box
from ..tools.world import PlanNode, Target, World
from .messages import Call, History, Message, Reply, Result, failed_before, replies_of, turn_of
from .outcomes import Answered, Cancelled, Outcome, Paused, Stopped
from .titles import title_of

Status = Literal[
    "deployed",
    "planned",
    "answered",
    "needs_approval",
    "question",
    "impossible",
    "stopped",
    "failed",
]
Since = Literal["begun", "ended"]
"""What a deployment beside a session has come to since the session's last turn ended."""
EXIT_CODES: dict[Status, int] = {
    "deployed": 0,
    "planned": 0,
    "answered": 0,
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
    robot order over all groups. `instruction` is what was said, with what answered questions.
    What does not apply is None; `metric` is the same in metres where
    the picture's scale is known, see `metric_data`.
    """

    model_config = ConfigDict(frozen=True)

    status: Status
    message: str
    instruction: str
    image: dict[str, Any] | None = None
    targets: tuple[dict[str, Any], ...] = ()
    candidates: tuple[dict[str, Any], ...] | None = None
    options: tuple[str, ...] | None = None
    contract: Contract | None = None
    plan_id: str | None = None
    parent: str | None = None
    robots: tuple[str, ...] | None = None
    positions: tuple[tuple[float, float], ...] | None = None
    headings_deg: tuple[float | None, ...] | None = None
    verdict: Verdict | None = None
    motion: MotionVerdict | None = None
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
        """The exit code of `formup run`."""
        return EXIT_CODES[self.status]


METRIC_FRAME = "metres, x right, y down, 0, 0 is the centre of the picture's top left pixel"


def metric_data(world: World, plan: Plan | None, arrival: Arrival | None) -> dict[str, Any] | None:
    """Return what a report says in metres, or None where the scale is not known.

    That is the positions as planned and as observed, how far off each is, and the certificate's
    measures.
    """
    scale = world.metres_per_pixel
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
    """Return a target as the report shows it."""
    outline, holes = rounded_rings(target.outline)
    return {
        "id": target.id,
        "label": target.label,
        "box": _box(target.box),
        "confidence": target.confidence,
        "parts": target.parts,
        "found_from": target.prompt,
        **({"note": target.note} if target.note else {}),
        "outline": outline,
        "holes": holes,
    }


def target_choice(target: Target) -> dict[str, Any]:
    """Return a target as a question offers it."""
    return {"id": target.id, "label": target.label, "box": _box(target.box)}


def candidate_choice(candidate: Candidate) -> dict[str, Any]:
    """Return a candidate as a question offers it."""
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
    outcome: Outcome,
    context: Context,
    began: World,
    model: str,
    seconds: float,
    since: Since | None = None,
) -> Report:
    """Return the report of a turn that ended with an outcome.

    Args:
        context: with the world as the turn left it.
        began: the world when the turn began.
        model: the model's name.
        seconds: how long the turn has taken.
        since: what a deployment has done after the turn's end.
    """
    world = context.world
    arrivals = {n: a for n, a in world.arrivals.items() if began.arrivals.get(n) is not a}
    plan = _plan(outcome, world, arrivals)
    arrival = arrivals.get(plan.id) if plan and since != "begun" else None
    new = plan is not None and _is_new(plan, world, began)
    status, message = _status(outcome, plan, arrival, new=new)
    if since is not None and plan is not None and not isinstance(outcome, Paused):
        status, message = deployed_since(plan, arrival, world.metres_per_pixel)
    verdict, motion = still_true(world.plans[plan.id], arrival) if plan else (None, None)
    if plan is not None and verdict is not None and (new or arrival is not None):
        message = _with_encounters(message, world.plans[plan.id], verdict)
    return Report(
        status=status,
        message=message,
        instruction=title_of(context.words, turn_of(outcome.messages)),
        image=_picture_data(context),
        targets=tuple(target_data(t) for t in world.targets),
        candidates=_candidates(outcome, context),
        options=_options(outcome),
        contract=suggested(outcome) or (plan.formation.contract if plan else None),
        plan_id=plan.id if plan else None,
        parent=world.plans[plan.id].parent if plan else None,
        positions=plan.formation.positions if plan else None,
        headings_deg=(plan.formation.headings_deg or None) if plan else None,
        robots=plan.formation.robots or None if plan else None,
        verdict=verdict,
        motion=motion,
        partial=plan.partial if plan else None,
        arrival=arrival,
        metric=metric_data(world, plan, arrival),
        model=model,
        usage=_totals(turn_of(outcome.messages), seconds),
    )


def _is_new(plan: Plan, world: World, began: World) -> bool:
    back = world.undone != began.undone and plan.id == world.current
    return back or world.plans[plan.id] is not began.plans.get(plan.id)


def _picture_data(context: Context) -> dict[str, Any]:
    world, notes, said = context.world, context.picture.notes, context.picture.metres_per_pixel
    if said not in (None, world.metres_per_pixel):
        notes = (*notes, f"{world.metres_per_pixel:g} m per pixel is used, as the person gave it")
    return world.picture.model_dump() | ({"notes": notes} if notes else {})


def _plan(outcome: Outcome, world: World, arrivals: Mapping[str, Arrival]) -> Plan | None:
    """Return the plan to report, or None.

    It is the plan that waits for a person, else the one deployed last, else the one that
    `report_impossible` names, unless void, else the current or else the last proposed one that is
    neither void nor partial. None is reported once undo has gone back to before the first plan.
    """
    if isinstance(outcome, Paused) and outcome.plan_id in world.plans:
        return world.plans[outcome.plan_id].plan
    if arrivals:
        return world.plans[list(arrivals)[-1]].plan
    given_up = _impossible_call(outcome.messages)
    named = given_up and given_up.arguments.get("plan_id")
    if named in world.plans and not world.is_void(world.plans[named].plan):
        return world.plans[named].plan
    if world.current is None and world.undone:
        return None
    latest = (world.plans[name].plan for name in (world.current, *reversed(world.plans)) if name)
    return next((p for p in latest if p.partial is None and not world.is_void(p)), None)


def suggested(outcome: Outcome) -> Contract | None:
    """Return the contract that a question or a refusal suggests instead, or None."""
    call = outcome.call if isinstance(outcome, Paused) else _impossible_call(outcome.messages)
    ends = call is not None and call.name in ("ask_user", "report_impossible")
    stated = call.arguments.get("contract") if call and ends else None
    return None if stated is None else Contract.model_validate(stated)


def _impossible_call(messages: History) -> Call | None:
    """Return the `report_impossible` call that ended the turn, or None."""
    last = messages[-1] if messages else None  # a run may be killed before its first message
    if not isinstance(last, Result) or last.name != "report_impossible" or last.error:
        return None
    calls = [c for m in turn_of(messages) if isinstance(m, Reply) for c in m.calls]
    return next(c for c in calls if c.id == last.call_id)


def _status(
    outcome: Outcome, plan: Plan | None, arrival: Arrival | None, *, new: bool
) -> tuple[Status, str]:
    """Return the status and message of a turn; `new` is whether the turn made the plan."""
    text = _last_words(outcome)
    if isinstance(outcome, Paused):
        asked = outcome.call.name == "ask_user"
        return ("question" if asked else "needs_approval"), text
    if arrival is not None and arrival.stopped:
        return "stopped", text
    if arrival is not None and not (isinstance(outcome, Stopped) and outcome.kind == "fleet"):
        # Robots have moved, whatever happened after that.
        done = arrival.done and _impossible_call(outcome.messages) is None
        return ("deployed" if done else "failed"), _with_arrival(outcome, arrival, text)
    if isinstance(outcome, Stopped):
        ours = outcome.kind in ("limit", "repeat")
        return ("stopped" if ours else "failed"), text
    if isinstance(outcome, Cancelled):
        return "stopped", text
    last = outcome.messages[-1]
    if isinstance(last, Result) and last.name == "report_impossible":
        return "impossible", text
    if plan is not None and plan.verdict.certified:
        return ("planned" if new else "answered"), text
    gave_up = new or not text.strip() or failed_before(outcome.messages[:-1])
    return ("answered" if isinstance(last, Reply) and not gave_up else "impossible"), text


def _with_arrival(outcome: Outcome, arrival: Arrival, text: str) -> str:
    """Return the message, stating the arrival first where something else ended the turn later."""
    if isinstance(outcome, Answered) or not arrival.arrived:
        return text
    return f"All robots had arrived. {text}"


def _with_encounters(text: str, node: PlanNode, verdict: Verdict) -> str:
    """Return the message, adding the verdict's notes on encountered things that it lacks."""
    said = [note for note in notes_of(node.encounters) if note in verdict.notes]
    return " ".join([text, *(note for note in said if note not in text)])


def deployed_since(plan: Plan, arrival: Arrival | None, scale: float | None) -> tuple[Status, str]:
    """Return status and message of a deployment; without an arrival it was broken off."""
    if arrival is None:
        return "stopped", (
            f"Robots were sent to plan {plan.id}, and that was broken off on the way: "
            "look where they stand."
        )
    state = "All arrived" if arrival.arrived else arrival.reason or "Not all arrived"
    furthest = length_text(max(arrival.residual_px), scale)
    told = [f"{state.rstrip('.')}; the furthest is {furthest} from its place."]
    told += [arrival.follow.told(scale)] if arrival.follow else []
    told += [f"The plan is partial: {plan.partial.sentence}"] if plan.partial else []
    status: Status = "deployed" if arrival.done else "stopped" if arrival.stopped else "failed"
    return status, " ".join(told)


def still_true(node: PlanNode, arrival: Arrival | None) -> tuple[Verdict, MotionVerdict | None]:
    """Return a plan's verdicts without what a drive has voided.

    Where robots were stopped, that is the motion, from where they stood, and what they meet on it
    and at its end; where they arrived, that they had a long way to go.
    """
    verdict = node.plan.verdict
    if arrival is None:
        return verdict, node.motion
    void = notes_of(node.encounters)
    if arrival.arrived:
        void = [met.sentence for met in node.encounters if met.how == "round"]
    notes = tuple(note for note in verdict.notes if note not in void)
    motion = node.motion if arrival.arrived else None
    return verdict.model_copy(update={"notes": notes}), motion


def _last_words(outcome: Outcome) -> str:
    if isinstance(outcome, Paused):
        call = outcome.call
        if call.name == "ask_user":
            return str(call.arguments["question"])
        if outcome.plan_id is None:
            return f"A person must approve {call.name} of {json.dumps(call.arguments)}."
        asked = f"A person must approve plan {outcome.plan_id} before robots move."
        node = outcome.world.plans.get(outcome.plan_id)
        if node is not None and (leave := call.arguments.get("follow")):
            target = " and ".join(node.plan.formation.contract.groups[0].targets)
            bounds = Follow.model_validate(leave).said(target, outcome.world.picture.size)
            asked = f"A person must approve plan {outcome.plan_id} and to {bounds}."
        if node is not None and node.plan.partial is not None:
            asked += f" That plan is partial: {node.plan.partial.sentence}"
        return asked
    if isinstance(outcome, Stopped):
        return outcome.reason
    if isinstance(outcome, Cancelled):
        return "It was stopped before its end; robots are held where they are."
    return outcome.text


def _candidates(outcome: Outcome, context: Context) -> tuple[dict[str, object], ...] | None:
    """Return what a question offers, in its order, without unknown ids; None without a question."""
    if not (isinstance(outcome, Paused) and outcome.call.name == "ask_user"):
        return None
    named = outcome.call.arguments.get("candidates", ())
    known = {t.id: target_choice(t) for t in context.world.targets}
    if any(n not in known for n in named):
        known |= {c.id: candidate_choice(c) for c in context.candidates()}
    return tuple(known[n] for n in named if n in known)


def _options(outcome: Outcome) -> tuple[str, ...] | None:
    """Return the answers that a question suggests, or None."""
    if not (isinstance(outcome, Paused) and outcome.call.name == "ask_user"):
        return None
    return tuple(map(str, outcome.call.arguments.get("options", ()))) or None


def _totals(messages: Sequence[Message], seconds: float) -> Totals:
    replies = replies_of(messages)
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
