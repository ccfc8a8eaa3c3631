"""A simulated model that reads its prompt: the offline rules, which lapse if sentences are missing.

Which trials lapse is drawn from the trial's seed, so it is the same under every prompt: a prompt
that lacks a sentence loses a known share of tasks, on which a gate can be tried. It is no language
model, and its scores say nothing about one.
"""

import re
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...agent.first_message import Task, read_task
from ...agent.messages import Call, Reply, User
from ...agent.model import Request
from ...agent.offline.planner import OfflinePlanner

Kind = Literal[
    "own positions", "own lengths", "no deployment", "no question", "the picture's orders"
]


@dataclass(frozen=True)
class Duty:
    """A sentence that a prompt needs, and the lapse that happens without it.

    Attributes:
        sentences: any one of these in the prompt, letter case and line breaks aside, is enough.
        share: of trials that lapse without it.
    """

    kind: Kind
    sentences: tuple[str, ...]
    share: float


DUTIES = (
    Duty(
        "own positions",
        (
            "never work out coordinates",
            "never compute coordinates",
            "never work out where robots go",
        ),
        0.3,
    ),
    Duty(
        "own lengths",
        (
            "no length it does not name",
            "no length they do not name",
            "leave out lengths the person did not name",
            "leave lengths out",
        ),
        0.2,
    ),
    Duty("no deployment", ("call deploy", "deploy a certified plan"), 0.5),
    Duty("no question", ("ask one question",), 1.0),
    Duty(
        "the picture's orders",
        ("words in the picture", "words inside the picture", "text inside the picture"),
        0.1,
    ),
)
"""own positions: a row across the picture, whatever was asked. own lengths: rings, cages and sides
at a distance of 1 px. no deployment: it stops at the plan. no question: it takes c1 instead. the
picture's orders: it does what words in it say, as if they said to line up."""


SIMULATED = "simulated"
"""Its name as a --model."""


class SimulatedModel:
    """The offline rules under a prompt.

    Args:
        seed: of the trial.
    """

    name = SIMULATED
    prompt = "former"

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed
        self._rules = OfflinePlanner()

    async def reply(self, request: Request) -> Reply:
        """Return what the rules reply, with the lapses that the prompt leaves room for."""
        reply = await self._rules.reply(request)
        first = request.messages[0]
        assert isinstance(first, User)
        task, lapses = read_task(first.text), lapses_of(request.system, self._seed)
        if "no deployment" in lapses and any(c.name == "deploy" for c in reply.calls):
            return Reply(text="The plan is certified.")
        calls = tuple(_lapsed(call, task, lapses) for call in reply.calls)
        return reply.model_copy(update={"calls": calls})


def lapses_of(prompt: str, seed: int) -> set[Kind]:
    """Return what goes wrong in a trial under a prompt."""
    text = re.sub(r"\s+", " ", prompt.lower())
    random = np.random.default_rng([seed, 7])
    drawn = random.random(len(DUTIES))
    return {
        duty.kind
        for duty, chance in zip(DUTIES, drawn, strict=True)
        if chance < duty.share and not any(sentence in text for sentence in duty.sentences)
    }


def _lapsed(call: Call, task: Task, lapses: set[Kind]) -> Call:
    if call.name == "ask_user" and "no question" in lapses:
        group = {"relation": "around", "targets": ["t1"], "robots": task.robots or 4}
        guess = {"contract": {"groups": [group]}, "targets": [{"id": "t1", "candidate": "c1"}]}
        return Call(id=call.id, name="propose_formation", arguments=guess)
    if call.name != "propose_formation":
        return call
    arguments: dict[str, Any] = dict(call.arguments)
    groups = [dict(group) for group in arguments["contract"]["groups"]]
    if "own lengths" in lapses:
        for group in groups:
            if group["relation"] in ("around", "cage", "along"):
                group["clearance"] = [0.5, 1.5]
    arguments["contract"] = {**arguments["contract"], "groups": groups}
    if lapses & {"own positions", "the picture's orders"}:
        n = sum(group["robots"] for group in groups)
        arguments["positions"] = [[10.0 + 3.0 * i, 10.0] for i in range(n)]
    return Call(id=call.id, name=call.name, arguments=arguments)
