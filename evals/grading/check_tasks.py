"""Check that a task can be trusted: a right answer scores 1, one without understanding does not.

Wrong ground truth is noticed late and by everybody at once; this finds it before a task is used.
"""

import numpy as np

from ...tools.errors import ToolError
from ..tasks.task import Task
from .attempts import grade_goals
from .policies import POLICIES, scores
from .reference_answers import reference


def check_task(task: Task) -> list[str]:
    """Return what is wrong with a task, as sentences; none if it can be trusted."""
    if not task.goals:
        return []
    try:
        placed = np.concatenate([reference(goal) for goal in task.goals])
    except ToolError as error:
        return [f"{task.id}: no right answer could be placed: {error}"]
    graded = grade_goals(task.goals, placed)
    problems = [] if graded.sr else [f"{task.id}: a right answer fails: {graded.feedback}."]
    crowd = sum(goal.robots for goal in task.goals) > 1  # one robot may only have to find the thing
    for name in POLICIES:
        if crowd and scores(name, task.goals)[0] == 1:
            problems.append(f"{task.id}: the policy {name}, which understands nothing, succeeds.")
    return problems
