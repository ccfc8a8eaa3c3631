"""Which things an instruction is about, and which others it names: "..., but clear of the lamp"."""

from ..first_message import Task
from ..messages import History
from .choosing import Found, Step, chosen_candidates, find
from .descriptions import Reference
from .drafting import things_needed
from .reading import Reading
from .references import described


def things_meant(
    task: Task, reading: Reading, named: list[str], history: History, *, pointed: bool
) -> list[Found] | Step:
    """Return the things meant, then those in `named`, or the call that has to come first."""
    needed = 0 if pointed else things_needed(reading)
    answers = chosen_candidates(history, needed + len(named)) if named else None
    found = [] if pointed else find(_references(task, reading), needed, history, answers)
    if isinstance(found, Step):
        return found
    for phrase in named:
        other = find(described([phrase]), 1, history, answers)
        if isinstance(other, Step) and pointed and not other.arguments:
            question = f'Which thing is "{phrase}"? Mark it as one to keep out of.'
            return Step("ask_user", {"question": question})
        if isinstance(other, Step):
            return other
        found += other
    return found


def _references(task: Task, reading: Reading) -> tuple[Reference, ...]:
    """Return what the phrases for things refer to; if none do, what the whole instruction does."""
    if len(reading.things) == things_needed(reading) > 1:  # the second repeats nothing
        each = [thing for phrase in reading.things for thing in described([phrase])]
        if len(each) == len(reading.things):
            return tuple(each)
    return described(reading.things) or described([task.instruction])
