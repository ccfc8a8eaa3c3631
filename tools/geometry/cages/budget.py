"""How many steps a search for cages may take: the same on every machine, a few seconds' worth.

A step is about a coarse flood of the configuration space of ten robots. What certifies in the end
takes steps too but is never refused any.
"""

from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar

STEPS = 150
_left: ContextVar[list[int] | None] = ContextVar("left", default=None)


@contextmanager
def search_budget() -> Generator[None]:
    """All searches within share the steps; within another budget they share that one's."""
    if _left.get() is not None:
        yield
        return
    token = _left.set([STEPS])
    try:
        yield
    finally:
        _left.reset(token)


def spend(steps: int) -> None:
    """Take steps from the budget, if there is one."""
    left = _left.get()
    if left is not None:
        left[0] -= steps


def cut_short() -> bool:
    """Whether the budget is spent, so that a search has to end."""
    left = _left.get()
    return left is not None and left[0] <= 0
