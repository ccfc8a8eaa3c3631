"""Formations one after the other, with a stop at each: "surround it, then line up left of it".

Each is read, placed, certified and driven to as an instruction of its own, from where the robots
then stand; the next one begins once all have arrived. What was done is read from the turn.
"""

import json
import re
from collections.abc import Callable
from dataclasses import replace

from ..first_message import Task
from ..messages import History, Message, Reply, Result
from .accounting import read_instruction
from .choosing import calls_in

FIRST = re.compile(r"^\W*(?:please )?first(?:ly| of all)?\b[\s,:]*", re.IGNORECASE)
THEN = re.compile(
    r"[\s,;.]*\b(?:(?:and )?then|(?:and )?after that|(?:and )?afterwards)\b[\s,:]*", re.IGNORECASE
)

Step = Callable[[Task, History, History, bool], Reply]
"""Next step for a task, from its turn's messages, those before, and whether it is a later stage."""


def stages_of(task: Task) -> tuple[str, ...]:
    """Return the instructions that words give in sequence; just one if not all can be read so."""
    parts = THEN.split(FIRST.sub("", task.instruction))
    if len(parts) < 2 or not task.deploy or task.standing:
        return (task.instruction,)
    readings = [read_instruction(words, task.metres_per_pixel) for words in parts]
    more = any(reading.robots for reading in readings[1:])  # others, or the same robots?
    unclear = any(r.stops or r.unread or not r.sure or r.relation == "ask" for r in readings)
    return (task.instruction,) if more or unclear else tuple(parts)


def in_stages(task: Task, turn: History, before: History, step: Step) -> Reply:
    """Return the next step of instructions that are carried out one after the other."""
    first, stages = turn[0], stages_of(task)
    told: list[str] = []
    left, stage = turn[1:], replace(task, instruction=stages[0])
    for words in stages[1:]:
        mine, later = _until_arrived(left)
        reply = step(stage, (first, *mine), before, bool(told))
        if later is None:
            return _with_earlier_texts(told, reply)
        told.append(reply.text)
        before, left = (*before, first, *mine), later
        stage = _next_stage(task, words, mine)
    return _with_earlier_texts(told, step(stage, (first, *left), before, bool(told)))


def _until_arrived(messages: History) -> tuple[History, History | None]:
    """Return a stage's messages and those after it, or None where not all robots have arrived."""
    for k, message in enumerate(messages):
        if isinstance(message, Result) and message.name == "deploy" and not message.error:
            if not json.loads(message.text).get("arrived"):
                break
            return messages[: k + 1], messages[k + 1 :]
    return messages, None


def _next_stage(task: Task, words: str, done: tuple[Message, ...]) -> Task:
    """Return the next stage's task: with as many robots, about the same thing if it names none."""
    proposed = [c for c in calls_in(done) if c.name == "propose_formation"][-1]
    groups = proposed.arguments["contract"]["groups"]
    reading = read_instruction(words, task.metres_per_pixel)
    robots = sum(group["robots"] for group in groups)
    things = () if reading.things else dict.fromkeys(t for g in groups for t in g["targets"])
    return replace(task, instruction=words, robots=robots, targets=tuple(things), pointed=())


def _with_earlier_texts(told: list[str], reply: Reply) -> Reply:
    """Return a reply; if it ends the turn or asks, the texts of the stages before come first."""
    said = " ".join(told)
    if not told:
        return reply
    if not reply.calls:
        return reply.model_copy(update={"text": f"{said} {reply.text}"})
    call, words = reply.calls[0], {"ask_user": "question", "report_impossible": "reason"}
    if call.name not in words:
        return reply
    name = words[call.name]
    arguments = call.arguments | {name: f"{said} {call.arguments[name]}"}
    return reply.model_copy(update={"calls": (call.model_copy(update={"arguments": arguments}),)})
