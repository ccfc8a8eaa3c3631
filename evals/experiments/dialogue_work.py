"""Dialogues with an agent, held turn by turn as a front end does, with every turn graded."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...agent.agent import Agent, Run
from ...agent.conversation import Session
from ...tools.context import Settings
from ...tools.perception.image import Picture
from ...tools.perception.target_prompt import TargetPrompt
from ..grading.dialogue import TurnGrade, grade_turn
from ..grading.dialogue_states import NOTHING, State, case_of
from ..tasks.task import Dialogue, Task
from .pointing import Pointing


@dataclass(frozen=True)
class DialogueRecord:
    """The record of a dialogue.

    Attributes:
        runs: after each turn.
        states: the same as graders see it.
        grades: of each turn.
    """

    runs: Sequence[Run]
    states: Sequence[State]
    grades: Sequence[TurnGrade]

    def as_data(self, dialogue: Dialogue) -> list[dict[str, Any]]:
        """Return what was said, what came of it and what was wrong, turn by turn, as JSON data."""
        return [
            {
                "words": turn.words,
                "expect": turn.expect,
                "status": state.status,
                "message": state.message,
                "plan_id": state.plan_id,
                "parent": state.parent,
                "robots": state.robots,
                "positions": state.positions.tolist(),
                "problems": grade.problems,
                "kept": grade.kept,
            }
            for turn, state, grade in zip(dialogue.turns, self.states, self.grades, strict=True)
        ]


def hold(
    agent: Agent,
    picture: Picture,
    task: Task,
    settings: Settings,
    pointing: Pointing,
    trace: Path | None,
) -> DialogueRecord:
    """Say every turn of a dialogue to an agent, whatever the results of those before, and grade it.

    Raises:
        ModelError, FleetError, OSError: as running an agent does.
    """
    dialogue = task.dialogue
    assert dialogue is not None
    talk = Session(agent, picture)
    runs, states, grades = list[Run](), [NOTHING], list[TurnGrade]()
    for turn in dialogue.turns:
        if talk.run is None:
            still = settings.model_copy(update={"may_deploy": False})
            shown: dict[str, Any] = pointing._asdict()
            talk.run = agent.run(picture, turn.words, **shown, settings=still, trace=trace)
        else:
            prompts = () if turn.point is None else (TargetPrompt(points=(turn.point,)),)
            talk.say(turn.words, pointed=prompts)
        runs.append(talk.run)
        after = state_of(talk.run)
        grades.append(grade_turn(turn, case_of(dialogue, states, after, task.metres_per_pixel)))
        states.append(after)
    return DialogueRecord(runs, states[1:], grades)


def state_of(run: Run) -> State:
    """Return the state after a turn, from its report."""
    report, world = run.report, run.world
    positions = np.asarray(report.positions or (), dtype=float).reshape(-1, 2)
    numbers = tuple(str(i) for i in range(1, len(positions) + 1))
    arrival = report.arrival
    off = () if report.contract is None else report.contract.keep_out
    return State(
        status=report.status,
        message=report.message,
        plan_id=report.plan_id,
        parent=report.parent,
        robots=report.robots or numbers,
        positions=positions,
        headings=report.headings_deg or (),
        certified=bool(report.verdict and report.verdict.certified),
        observed=None if arrival is None else np.asarray(arrival.observed).reshape(-1, 2),
        kept_off=tuple(t.outline.polygon for t in world.targets if t.id in off),
    )
