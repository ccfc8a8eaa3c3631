"""Lengths said in widths of a robot, "two robot widths away", which are put into pixels.

Where nothing says how large the robots are, the person is asked; an answer takes their place.
"""

import re
from dataclasses import replace

from ...tools.formation.number_words import numbers_in
from ...tools.formation.quantities import quantities_in
from ..first_message import Task
from ..messages import Call, History, Message, Reply, Result
from .choosing import calls_in

WIDTHS = re.compile(
    r"[\s-]*(?:good )?(?:(?:robot|bot|unit|machine|rover|vehicle|drone|body)(?:s|'s|s'|\u2019s)?"
    r"[\s-]+(?:widths?|breadths?|diameters?|wide|broad|lengths?)|widths|bodies)\b",
    re.IGNORECASE,
)
"""What follows on a number of widths."""
ONE = re.compile(
    r"\b(?:a|one|half a) (?:single )?(?:robot|bot|unit|machine|rover|vehicle|drone|body)"
    r"(?:'s|\u2019s)?[\s-]+(?:width|breadth|diameter|length)\b",
    re.IGNORECASE,
)


def with_widths(task: Task, turn: History) -> tuple[Task, History] | Reply:
    """Return the task with widths of robots in px and the turn, or the question how wide one is."""
    spans = _widths_in(task.instruction)
    if not spans:
        return task, turn
    quoted = task.instruction[spans[0][0] : spans[0][1]]
    question = f'"{quoted}" cannot be measured: nothing says how wide a robot is. How many pixels?'
    answered, left = _answered(turn, question, task.metres_per_pixel)
    width = 2 * task.robot_radius if task.robot_radius else answered
    if width is None:
        asked = Call(id="call", name="ask_user", arguments={"question": question})
        return Reply(calls=(asked,))
    text = task.instruction
    for start, end, count in reversed(spans):
        text = f"{text[:start]}{count * width:g} px{text[end:]}"
    return replace(task, instruction=text), left


def _widths_in(text: str) -> list[tuple[int, int, float]]:
    """Return first and past-the-last character of each length in widths, and how many they are."""
    found = [
        (m.start(), m.end(), 0.5 if m[0].lower().startswith("half") else 1.0)
        for m in ONE.finditer(text)
    ]
    taken = [range(start, end) for start, end, _ in found]
    for number in numbers_in(text):
        unit = WIDTHS.match(text, number.end)
        if unit and number.least == number.most and not any(number.start in r for r in taken):
            found.append((number.start, unit.end(), number.least))
    return sorted(found)


def _answered(
    turn: History, question: str, scale: float | None
) -> tuple[float | None, tuple[Message, ...]]:
    """Return the width, px, that a question was answered with, and the turn without the two."""
    ids = {c.id for c in calls_in(turn) if c.arguments.get("question") == question}
    width: float | None = None
    kept: list[Message] = []
    for message in turn:
        said = quantities_in(message.text) if isinstance(message, Result) else ()
        if isinstance(message, Result) and message.call_id in ids and len(said) == 1:
            px = said[0].px(scale) if said[0].is_length else (said[0].least, said[0].most)
            if px is not None and 0 < px[0] == px[1]:
                width = px[0]
        kept.append(message)
    answers = [k for k, m in enumerate(kept) if isinstance(m, Result) and m.call_id in ids]
    dropped = {k - j for k in answers for j in (0, 1)}
    return width, tuple(m for k, m in enumerate(kept) if k not in dropped)
