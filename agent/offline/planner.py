"""The offline planner: rules in a model's place, so that everything runs with no key and no GPU.

It reads the arrangement and the thing meant from phrase tables, has tools measure them, and
asks when the words do not settle what to do. It is no language model: it sees measures only.
"""

import json
from itertools import count
from typing import Any

from ...tools.formation.contract import MAX_ROBOTS
from ...tools.formation.units import length_text
from ..first_message import Task, read_task
from ..messages import Call, History, Reply, Result, User, turn_of
from ..model import Request
from .arrangements import Reading, understand
from .choosing import Step, calls_in, find, located_reasons
from .drawn_forms import ENCLOSING, READING, Form, faced_in, form_in
from .references import Reading as Words
from .references import references

MAX_LABEL = 100
FARTHEST = 100_000
"""Inside, a length that is named is the least distance from the edge, px."""
DISTANCELESS = {"between": "between", "centre": "at the centre of"}
UNSCALED = "Metres take a picture of known scale: run again with --metres-per-pixel."
EXAMPLES = "around it, at its corners, along its left side, inside it, between two things, or caged"


class OfflinePlanner:
    """Rules that call the tools: propose, deploy, say what was observed."""

    name = "offline"

    async def reply(self, request: Request) -> Reply:
        """The next step for a conversation that began with a task message."""
        turn = tuple(turn_of(request.messages))
        reply = _next_step(turn, request.messages[: -len(turn)])
        number = sum(isinstance(m, Reply) for m in request.messages) + 1
        calls = tuple(c.model_copy(update={"id": f"call-{number}"}) for c in reply.calls)
        return reply.model_copy(update={"calls": calls})


def _next_step(turn: History, before: History) -> Reply:
    """What to do next in a turn, which began with a task message, after those before."""
    first = turn[0]
    assert isinstance(first, User)
    task = read_task(first.text)
    last = turn[-1]
    if isinstance(last, Result) and last.name == "propose_formation":
        return _after_proposal(task, last, turn, before)
    if isinstance(last, Result) and last.name == "deploy":
        return Reply(text=_after_deploy(task, last, turn))
    if isinstance(last, Result) and last.error:
        return Reply(text=_left_off(last, turn))
    return _begin(task, turn, before)


def _begin(task: Task, history: History, before: History) -> Reply:
    """Propose a formation, or find and ask what is missing."""
    pointed = bool(_target_ids(task))
    form, without_form = form_in(task.instruction)
    spoken, faced = _spoken(without_form, pointed)
    answers = _spoken_answers(history)
    reading = understand(". ".join([spoken.rest, *answers]), task.metres_per_pixel)
    bare = [int(a) for a in answers if a.strip().isascii() and a.strip().isdecimal()]
    wording = reading.robots or (form.robots if form else None)
    robots = task.robots or wording or next(iter(bare), None)
    things = 2 if "between" in reading.relations or faced else 1
    question = _unfit(reading, form, faced, robots) or _open_question(task, reading, robots, things)
    if question or robots is None:
        return _call("ask_user", {"question": question or "How many robots?"})
    prompts = [p for p in task.pointed if p["id"] not in task.targets]
    if not pointed:
        found = find(spoken.things, things, history)
        if isinstance(found, Step):
            return _call(found.name, found.arguments)
        prompts = _prompts([(f.candidate, _label(f.wording)) for f in found], before)
    ids = list(dict.fromkeys([*task.targets, *(p["id"] for p in prompts)]))[:things]
    contract: dict[str, Any] = {"groups": [_group_by_relation(reading, robots, ids)]}
    if faced:
        contract["groups"] = [_group_facing(reading, robots, ids)]
    elif form:
        contract["groups"] = [_group_drawn(reading, form, robots, ids, history)]
        contract |= {"reading": READING} if _was_doubted(history) else {}
    if reading.robot_radius is not None:
        contract["robot_radius"] = reading.robot_radius
    if task.metres_per_pixel is not None:
        contract["unit"] = "px"
    return _call("propose_formation", {"contract": contract, "targets": prompts})


def _prompts(found: list[tuple[str, str]], before: History) -> list[dict[str, Any]]:
    """Candidates and their labels as targets: those of earlier turns keep their ids."""
    calls = [c for m in before if isinstance(m, Reply) for c in m.calls]
    given: list[Any] = [t for c in calls for t in c.arguments.get("targets") or ()]
    earlier: list[dict[str, Any]] = [t for t in given if isinstance(t, dict) and "id" in t]
    known = {t["candidate"]: t["id"] for t in earlier if "candidate" in t}
    used = {t["id"] for t in earlier}
    free = (name for i in count(1) if (name := f"t{i}") not in used)
    return [
        {"id": known.get(name) or next(free), "candidate": name, "label": label}
        for name, label in found
    ]


def _spoken(without_form: str, pointed: bool) -> tuple[Words, bool]:
    """The things an instruction speaks of, what is left of it, and whether a side faces one."""
    main, faced = faced_in(without_form)
    if faced is None:
        return (Words((), without_form) if pointed else references(without_form)), False
    if pointed:
        return Words((), f"{main} {faced.partition(' ')[2]}"), True
    first, second = references(main), references(faced)
    rest = f"{first.rest} {second.rest.removeprefix('it')}"
    return Words((*first.things, *second.things), rest), True


def _unfit(reading: Reading, form: Form | None, faced: bool, robots: int | None) -> str | None:
    """What to ask where a form has no place by the thing, or a side that faces it is no side."""
    if reading.beyond:
        return None
    if faced and (form or reading.relations != ("along",) or reading.side is not None):
        return (
            "The offline rules know of one thing that faces another only the side that robots "
            "line up along. Which side is meant?"
        )
    if form is None:
        return None
    if form.robots is not None and robots not in (None, form.robots):
        return (
            f"{form.wording} takes {form.robots} robots, {robots} were named. Which?".capitalize()
        )
    if form.where(reading.relations, reading.side, 0) is None:
        around = ", around" if form.shape["kind"] in ENCLOSING else ""
        return (
            f"Where are the robots to draw {form.wording}? Inside a thing{around}, or left, right, "
            "above or below."
        )
    return None


def _group_drawn(
    reading: Reading, form: Form, robots: int, targets: list[str], history: History
) -> dict[str, Any]:
    where = form.where(reading.relations, reading.side, _refusals(history))
    group = _group_basics(reading, robots, targets) | {
        "relation": "shape",
        "shape": form.shape | {"where": where},
    }
    return group | _distance(reading, deep=where == "inside")


def _group_facing(reading: Reading, robots: int, targets: list[str]) -> dict[str, Any]:
    group = _group_basics(reading, robots, targets[:1])
    return group | {"relation": "along", "facing": targets[1]} | _distance(reading, deep=False)


def _refusals(history: History) -> int:
    """How many places beside a thing had no room."""
    return sum(isinstance(m, Result) and m.cause == "no_room_beside" for m in history)


def _was_doubted(history: History) -> bool:
    return any(isinstance(m, Result) and m.cause == "doubt" for m in history)


def _left_off(result: Result, history: History) -> str:
    """What there is to say when a call was refused or took too long: what it was about, and why."""
    meant = next(c.arguments for c in calls_in(history) if c.id == result.call_id)
    wording = meant.get("question") or meant.get("reason") or "The thing meant was not looked for."
    return f"{wording} {result.text}"


def _spoken_answers(history: History) -> list[str]:
    """Answers in words and numbers of robots, not those that choose a candidate."""
    offered = {c.id for c in calls_in(history) if c.arguments.get("candidates")}
    asked = [m for m in history if isinstance(m, Result) and m.name == "ask_user"]
    return [m.text for m in asked if m.call_id not in offered]


def _label(wording: str) -> str:
    """What a thing is called: the words for it without their article."""
    return wording.split(" ", 1)[-1][:MAX_LABEL]


def _open_question(task: Task, reading: Reading, robots: int | None, used: int) -> str | None:
    """What has to be asked before a number of things is looked for, or None."""
    return _which_arrangement(reading) or _how_many(reading, robots) or _which_things(task, used)


def _which_arrangement(reading: Reading) -> str | None:
    if reading.beyond:
        wording = " and ".join(reading.beyond)
        return (
            f"The offline rules do not carry out {wording}. Say it another way: one arrangement of "
            "all the robots, lengths in px." + (f" {UNSCALED}" if reading.unscaled else "")
        )
    if not reading.relations:
        return f"Which arrangement is meant? For example {EXAMPLES}."
    if len(reading.relations) > 1:
        return f"Which arrangement is meant: {' or '.join(reading.relations)}?"
    where = DISTANCELESS.get(next(iter(reading.relations)))
    if reading.clearance is not None and where:
        return f"No distance is kept to what robots stand {where}. Which arrangement is meant?"
    return None


def _how_many(reading: Reading, robots: int | None) -> str | None:
    if robots is None and reading.odd_count:
        return f"How many robots? {reading.odd_count!r} names no whole number above 0."
    if robots is not None and robots > MAX_ROBOTS:
        return f"How many robots? {robots:,} are more than the {MAX_ROBOTS:,} that can be placed."
    return None if robots else "How many robots? Say it in the words or with -n."


def _which_things(task: Task, used: int) -> str | None:
    things = len(_target_ids(task))
    if things == 1 and used == 2:
        return "Which two things? Point at both: --point X,Y --point X,Y."
    if things > used:
        named = ", ".join(_target_ids(task))
        return f"{things} things were pointed at ({named}), the arrangement is about {used}. Which?"
    return None


def _group_by_relation(reading: Reading, robots: int, targets: list[str]) -> dict[str, Any]:
    (relation,) = reading.relations
    group = _group_basics(reading, robots, targets) | {"relation": relation}
    if relation == "cage":
        group["spacing"] = "even"
    if relation == "along":
        group["side"] = reading.side or "long"
    if relation == "cage" and reading.escape_proof:
        group["closure"] = "escape-proof"
    if relation == "between":
        group["layout"] = reading.layout
    if relation in ("between", "centre"):
        return group
    return group | _distance(reading, deep=relation == "inside")


def _group_basics(reading: Reading, robots: int, targets: list[str]) -> dict[str, Any]:
    group: dict[str, Any] = {
        "targets": targets,
        "robots": robots,
        "fit": reading.fit,
        "spacing": reading.spacing,
    }
    apart = reading.min_spacing
    return group if apart is None else group | {"min_spacing": apart}


def _distance(reading: Reading, *, deep: bool) -> dict[str, Any]:
    """The clearance that is named; inside the least, which leaves open how deep."""
    if reading.clearance is None:
        return {}
    return {"clearance": [reading.clearance, FARTHEST if deep else reading.clearance + 1]}


def _target_ids(task: Task) -> list[str]:
    return list(dict.fromkeys([*task.targets, *(p["id"] for p in task.pointed)]))


def _after_proposal(task: Task, result: Result, history: History, before: History) -> Reply:
    if result.error:
        if result.cause == "no_room_beside" and _may_move_on(task, history):
            return _begin(task, history, before)
        if result.cause == "doubt" and form_in(task.instruction)[0]:
            return _begin(task, history, before)
        if result.cause == "low_confidence":
            return _call("ask_user", {"question": result.text})
        facts = result.facts or {}
        return _impossible(history, facts.get("plain", result.text), facts.get("partial_plan"))
    plan = json.loads(result.text)
    if not plan["certified"]:
        partial = plan.get("partial")
        reason = [*plan["findings"], *([partial["sentence"]] if partial else [])]
        return _impossible(history, " ".join(reason), (partial or plan)["plan_id"])
    if task.deploy:
        return _call("deploy", {"plan_id": plan["plan_id"]})
    return Reply(text=f"{_planned(plan, history)} Nothing was moved.")


def _may_move_on(task: Task, history: History) -> bool:
    """Whether a form beside a thing, with no room on one side of it, has another to be tried."""
    form, without_form = form_in(task.instruction)
    reading = understand(_spoken(without_form, bool(_target_ids(task)))[0].rest)
    if form is None or reading.side is not None:
        return False
    return form.where(reading.relations, None, _refusals(history)) is not None


def _impossible(history: History, reason: str, plan_id: str | None) -> Reply:
    """Give up, in the words of the tool, with the best plan there is."""
    arguments = {"reason": reason} | ({"plan_id": plan_id} if plan_id else {})
    return _call("report_impossible", arguments)


def _after_deploy(task: Task, result: Result, history: History) -> str:
    proposal = next(
        m for m in reversed(history) if isinstance(m, Result) and m.name == "propose_formation"
    )
    planned = _planned(json.loads(proposal.text), history)
    if result.error:
        return f"{planned} {result.text}"
    arrival = json.loads(result.text)
    worst = length_text(arrival["worst_residual_px"], task.metres_per_pixel)
    off = f"{worst} from its place"
    wording = f"All arrived; the furthest is {off}."
    if not arrival["arrived"]:
        corrected = f"after {arrival['corrections']} corrections"
        wording = f"Robot {arrival['worst_robot']} stopped {off} {corrected}."
    return f"{planned} {wording}"


def _planned(plan: dict[str, Any], history: History) -> str:
    noun = "robot has a certified place" if plan["robots"] == 1 else "robots have certified places"
    placed = f"{plan['robots']} {noun} (plan {plan['plan_id']})."
    return " ".join([*_taken(history), placed, *plan["notes"]])


def _taken(history: History) -> list[str]:
    """Which candidates were taken for the things meant, and why."""
    last = next(c for c in calls_in(history)[::-1] if c.name == "propose_formation")
    reasons = located_reasons(history)
    return [
        f"Took {p['candidate']} for the {p.get('label') or 'thing chosen'}"
        + (f": {'; '.join(reasons[p['candidate']])}." if reasons.get(p["candidate"]) else ".")
        for p in last.arguments["targets"]
        if p.get("candidate")
    ]


def _call(name: str, arguments: dict[str, Any]) -> Reply:
    return Reply(calls=(Call(id="call", name=name, arguments=arguments),))
