"""The offline planner: rules instead of a model, so that everything runs with no key and no GPU.

It reads the arrangement and the thing meant by phrase tables, has tools measure them, and asks
when the words do not settle what to do. It is not a language model and sees only measures.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..answers import says_yes
from ..first_message import Task, read_task
from ..messages import Call, History, Message, Reply, Result, User, turn_of
from ..model import Request
from .accounting import read_instruction
from .answering import arrived
from .besides import dropped, saying, without_besides
from .body_widths import with_widths
from .choosing import Step, calls_in, candidate_notes, names_things, prompts_of
from .conversing import conversed
from .counting import (
    FEWEST,
    corner_count,
    count_edit,
    count_left_open,
    counted,
    counts_corners,
    refused,
    without_closure,
)
from .derived import about_derived
from .drafting import (
    contract_of,
    options_of,
    place_of,
    question_of,
    things_needed,
    which_things,
    would_do,
)
from .escorting import following
from .followup_places import with_places
from .followup_things import stood_about
from .meant import things_meant
from .options import agrees, declines, option_at
from .pointed import chosen_by_answer, labelled, narrowed
from .reading import Reading
from .restated import LEFT_OUT, Restated, restated
from .sequences import in_stages, stages_of
from .several import about_several
from .spelling import spelled
from .standing import Standing

MAX_LABEL = 100
ONE_AT_A_TIME = (
    "Those are formations one after the other, each from where robots arrived in the one before: "
    "only one can be planned without moving robots. Say that one alone."
)
READING = "The rules account for every word; the rest of them says which thing is meant."
"""Answer to a doubt about the reading, which arises from single words."""


class OfflinePlanner:
    """Rules that call the tools: propose, deploy, say what was observed."""

    name = "offline"
    reads_all = True

    async def reply(self, request: Request) -> Reply:
        """Return the next step of a conversation that began with a task message."""
        turn = tuple(turn_of(request.messages))
        before = request.messages[: -len(turn)]
        left = without_besides(turn, before)
        if isinstance(left, Reply):
            reply = left
        else:
            told = dropped(turn, before) or left[1]
            reply = saying(told, _next_step(left[0], before))
        number = sum(isinstance(m, Reply) for m in request.messages) + 1
        calls = tuple(c.model_copy(update={"id": f"call-{number}"}) for c in reply.calls)
        return reply.model_copy(update={"calls": calls})


def _next_step(turn: History, before: History) -> Reply:
    """Return the next step of a turn that began with a task message; `before` are earlier ones."""
    first = turn[0]
    assert isinstance(first, User)
    sized = with_widths(read_task(first.text), _without_agreed(turn))
    if isinstance(sized, Reply):
        return sized
    task, agreed = sized
    return following(task, turn, lambda t: in_stages(t, agreed, before, _step_of))


def _step_of(task: Task, turn: History, before: History, later: bool) -> Reply:
    """Return the next step for one instruction, which may be a later one of a sequence."""
    if isinstance(turn[-1], Result) and _ends_in_outline_question(turn[:-1]):
        return _after_outline_answer(turn[-1])
    placed = with_places(task, turn)
    if isinstance(placed, Reply):
        return placed
    spoken = placed if later else conversed(*placed, before)
    if isinstance(spoken, Reply):
        return spoken
    task, turn = spoken
    last = turn[-1]
    if isinstance(last, Result) and last.name == "propose_formation":
        return _after_proposal(task, last, turn, before)
    if isinstance(last, Result) and last.name == "edit_formation":
        plan = counted(last, turn)
        return _planned_or_deployed(task, plan, turn) if plan else refused(last)
    if isinstance(last, Result) and last.name == "deploy":
        return Reply(text=_after_deploy(task, last, turn))
    if isinstance(last, Result) and last.error:
        return Reply(text=_failure_text(last, turn))
    return _begin(task, turn, before)


def _without_agreed(turn: History) -> History:
    """Return the turn without calls that doubted an outline to which the person then agreed."""
    kept: list[Message] = []
    for message in turn:
        agreed = isinstance(message, Result) and says_yes(message.text)
        if agreed and _ends_in_outline_question(kept):
            del kept[-3:]
        else:
            kept.append(message)
    return tuple(kept)


def _after_outline_answer(answer: Message) -> Reply:
    """Return the reply to an answer other than yes about a doubtful outline."""
    reason = "Nothing was placed, as you said no."
    if not declines(answer.text):
        said = f'"{answer.text.strip()}" does not say whether the outline shown is right'
        reason = f"Nothing was placed: {said}. Say it once more, best with a rough outline."
    return _call("report_impossible", {"reason": reason})


def _ends_in_outline_question(messages: Sequence[Message]) -> bool:
    """Return whether messages end in a question about an outline of too low confidence."""
    refused, asked = (None, None, *messages)[-2:]
    doubted = isinstance(refused, Result) and refused.cause == "low_confidence"
    return doubted and isinstance(asked, Reply) and [c.name for c in asked.calls] == ["ask_user"]


def _begin(task: Task, history: History, before: History) -> Reply:
    """Propose a formation, or look for a thing or ask for what is missing."""
    still_open, chosen = _restated_instruction(task, history).open, _narrowed(task, history)
    if isinstance(chosen, Reply):
        return chosen
    shown, task = task.pointed, chosen
    reading = read_instruction(task.instruction, task.metres_per_pixel)
    reading = replace(reading, unread=[*still_open, *reading.unread])
    if _given_count(task, history):
        reading = replace(reading, count="")
    robots = _robot_count(task, reading, history)
    question = question_of(task, reading, robots)
    if not task.deploy and len(stages_of(replace(task, deploy=True))) > 1:
        question = ONE_AT_A_TIME
    if question or robots is None:
        asked: dict[str, Any] = {"question": question or "How many robots?"}
        options = options_of(task, reading, question or "")
        asked |= {"options": list(options)} if options else {}
        ids = _target_ids(task)
        if robots and ids and would_do(task, reading, robots):
            asked["contract"] = _in_unit(task, contract_of(reading, robots, ids, []))
        return _call("ask_user", asked)
    needed = things_needed(reading)
    ids, others = _target_ids(task)[:needed], _target_ids(task)[needed:]
    if not ids and task.standing:
        ids = stood_about(reading.things, Standing.of(task.standing))[:needed]
    prompts = labelled([p for p in shown if p["id"] not in task.targets], reading.things)
    named = [] if others else reading.named
    found = things_meant(task, reading, named, history, pointed=bool(ids))
    if isinstance(found, Step):
        return _call(found.name, found.arguments)
    if found:
        looked_for = prompts_of([(f.candidate, _label(f.wording)) for f in found], before, ids)
        prompts = [*prompts, *looked_for]
        ids, others = _split_last([*ids, *(p["id"] for p in looked_for)], len(named))
    contract = _in_unit(task, contract_of(reading, robots, ids, others, _refusals(history)))
    contract = without_closure(contract, count_left_open(reading))
    if _was_doubted(history):
        contract["reading"] = READING
    return _call("propose_formation", {"contract": contract, "targets": prompts})


def _narrowed(task: Task, history: History) -> Task | Reply:
    """Return the task about the pointed things that its words choose, or what comes first."""
    agreed = _agreed(task, history)
    if agreed is not None:
        return agreed
    task, answers = _chosen_by_answers(task, history)
    task = replace(task, instruction=restated(task, answers).text)
    number = task.robots or _number_answered(history)
    several = about_derived(task, number, history) or about_several(task, number, history)
    if several is not None:
        if several.name == "propose_formation" and _was_doubted(history):
            several.arguments["contract"] |= {"reading": READING}
        return _call(several.name, several.arguments)
    chosen = narrowed(task, history)
    return _call(chosen.name, chosen.arguments) if isinstance(chosen, Step) else chosen


def _chosen_by_answers(task: Task, history: History) -> tuple[Task, list[str]]:
    """Return the task about the pointed things that answers chose, and the other answers."""
    left: list[str] = []
    for question, answer in _answered(history):
        reading = read_instruction(restated(task, left).text, task.metres_per_pixel)
        which = which_things(task, reading)
        asked = which is not None and question.endswith(which)
        chosen = chosen_by_answer(task, answer, history) if asked else None
        task = chosen or task
        left += [] if chosen else [answer]
    return task, left


def _in_unit(task: Task, contract: dict[str, Any]) -> dict[str, Any]:
    return contract if task.metres_per_pixel is None else contract | {"unit": "px"}


def _agreed(task: Task, history: History) -> Reply | None:
    """Return the reply to a yes, no or "leave it out" about words not understood, else None."""
    asked = [c for c in calls_in(history) if c.name == "ask_user" and "contract" in c.arguments]
    if not asked:
        return None
    answer = next((m for m in history if isinstance(m, Result) and m.call_id == asked[-1].id), None)
    if answer is None or not answer.text.strip():
        return None
    if declines(answer.text):
        return _call("report_impossible", {"reason": "Nothing was placed, as you said no."})
    if not agrees(answer.text) and LEFT_OUT.fullmatch(answer.text) is None:
        return None
    contract: dict[str, Any] = asked[-1].arguments["contract"]
    if _was_doubted(history):
        contract = contract | {"reading": READING}
    prompts = [p for p in task.pointed if p["id"] not in task.targets]
    things = read_instruction(task.instruction, task.metres_per_pixel).things
    prompts = labelled(prompts, things)
    return _call("propose_formation", {"contract": contract, "targets": prompts})


def _split_last(ids: list[str], last: int) -> tuple[list[str], list[str]]:
    """Split ids into all but the last `last`, and those."""
    return ids[: len(ids) - last], ids[len(ids) - last :]


def _refusals(history: History) -> int:
    """Return how many places beside a thing had no room."""
    return sum(isinstance(m, Result) and m.cause == "no_room_beside" for m in history)


def _was_doubted(history: History) -> bool:
    return any(isinstance(m, Result) and m.cause == "doubt" for m in history)


def _failure_text(result: Result, history: History) -> str:
    """Return the text for a call that was refused or took too long: what it was about, and why."""
    meant = next(c.arguments for c in calls_in(history) if c.id == result.call_id)
    wording = meant.get("question") or meant.get("reason") or "The thing meant was not looked for."
    return f"{wording} {result.text}"


def _restated_instruction(task: Task, history: History) -> Restated:
    """Return what the instruction and the answers to questions about it say together."""
    return restated(*_chosen_by_answers(task, history))


def _answered(history: History) -> list[tuple[str, str]]:
    """Return the questions that offered no things, each with the answer or the option it chose."""
    calls = [c for c in calls_in(history) if not (c.arguments.get("candidates") or names_things(c))]
    asked = {c.id: c.arguments for c in calls}
    answers = [m for m in history if isinstance(m, Result) and m.name == "ask_user"]
    answered = [(asked[m.call_id], m.text) for m in answers if m.call_id in asked]
    return [(str(a["question"]), spelled(_settled(a, text))) for a, text in answered]


def _settled(asked: Mapping[str, Any], answer: str) -> str:
    """Return the option that an answer chooses by its number or rank, else the answer."""
    options: Sequence[str] = asked.get("options", ())
    at = option_at(answer, len(options))
    return answer.strip() if at is None else options[at]


def _number_answered(history: History) -> int | None:
    """Return the number of robots in an answer that is just a number, else None."""
    answers = (answer for _, answer in _answered(history))
    return next((int(t) for t in answers if t.isascii() and t.isdecimal()), None)


def _standing_count(task: Task) -> int | None:
    """Return how many robots the plan has that a later turn begins with; None without a plan."""
    return len(task.standing["robots"]) if task.standing else None


def _robot_count(task: Task, reading: Reading, history: History) -> int | None:
    """Return how many robots are wanted; None where the person has to be asked."""
    wording = reading.robots or (reading.form.robots if reading.form else None)
    robots = task.robots or wording or _given_count(task, history)
    robots = robots or (corner_count(history) if counts_corners(reading) else None)
    return robots or (FEWEST if count_left_open(reading) else None)


def _label(wording: str) -> str:
    """Return a thing's label: the words for it without their article."""
    return wording.split(" ", 1)[-1][:MAX_LABEL]


def _target_ids(task: Task) -> list[str]:
    return list(dict.fromkeys([*task.targets, *(p["id"] for p in task.pointed)]))


def _after_proposal(task: Task, result: Result, history: History, before: History) -> Reply:
    if result.error:
        again = result.cause == "no_room_beside" and _may_move_on(task, history)
        if again or (result.cause == "doubt" and not _was_doubted(history[:-1])):
            return _begin(task, history, before)
        facts = result.facts or {}
        if result.cause == "low_confidence":
            return _call("ask_user", {"question": facts.get("plain", result.text)})
        return _impossible(history, facts.get("plain", result.text), facts.get("partial_plan"))
    plan = json.loads(result.text)
    said = _restated_instruction(task, history).text
    reading = read_instruction(said, task.metres_per_pixel)
    main = plan["robots"] - sum(count for _, count in reading.further)
    counts = counts_corners(reading) and main != _robot_count(task, reading, history)
    if counts and not task.standing:
        return _begin(task, history, before)
    if not plan["certified"]:
        partial = plan.get("partial")
        reason = [*plan["findings"], *([partial["sentence"]] if partial else [])]
        return _impossible(history, " ".join(reason), (partial or plan)["plan_id"])
    settling = None if _given_count(task, history) else count_edit(reading, result, plan)
    return settling or _planned_or_deployed(task, plan, history)


def _given_count(task: Task, history: History) -> int | None:
    """Return the number of robots that was given apart from the instruction; None if none was."""
    return task.robots or _number_answered(history) or _standing_count(task)


def _planned_or_deployed(task: Task, plan: dict[str, Any], history: History) -> Reply:
    if task.deploy:
        return _call("deploy", {"plan_id": plan["plan_id"]})
    return Reply(text=f"{_planned(task, plan, history)} Nothing was moved.")


def _may_move_on(task: Task, history: History) -> bool:
    """Return whether a form that had no room on one side of a thing has another side to try."""
    reading = read_instruction(task.instruction, task.metres_per_pixel)
    if reading.form is None or "side" in reading.group:
        return False
    return place_of(reading, _refusals(history)) is not None


def _impossible(history: History, reason: str, plan_id: str | None) -> Reply:
    """Give up with the tool's reason and the best plan there is, if any."""
    arguments = {"reason": reason} | ({"plan_id": plan_id} if plan_id else {})
    return _call("report_impossible", arguments)


def _after_deploy(task: Task, result: Result, history: History) -> str:
    proposal = next(
        m for m in reversed(history) if isinstance(m, Result) and m.name == "propose_formation"
    )
    planned = _planned(task, json.loads(proposal.text), history)
    if result.error:
        return f"{planned} {result.text}"
    return f"{planned} {arrived(json.loads(result.text), task.metres_per_pixel)}"


def _planned(task: Task, plan: dict[str, Any], history: History) -> str:
    noun = "robot has a certified place" if plan["robots"] == 1 else "robots have certified places"
    placed = f"{plan['robots']} {noun} (plan {plan['plan_id']})."
    return " ".join(
        [*candidate_notes(history), placed, *plan["notes"], *_reading_notes(task, history)]
    )


def _reading_notes(task: Task, history: History) -> list[str]:
    """Return sentences on words that only named the thing, changed nothing, or were left out."""
    stated = _restated_instruction(task, history)
    reading = read_instruction(stated.text, task.metres_per_pixel)
    told = {
        "Read as words for what was pointed at": reading.things if _target_ids(task) else [],
        "Read as background, which changes nothing": reading.background,
        "Not understood and left out, for what was answered": [*stated.left_out],
    }
    return [f"{what}: {_quoted(words)}." for what, words in told.items() if words]


def _quoted(words: list[str]) -> str:
    return ", ".join(f'"{quote}"' for quote in dict.fromkeys(words))


def _call(name: str, arguments: dict[str, Any]) -> Reply:
    return Reply(calls=(Call(id="call", name=name, arguments=arguments),))
