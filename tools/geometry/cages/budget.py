"""Limits a search for cages by a count of steps, which is the same on every machine.

The budget is worth a few seconds; a step is about one coarse flood of the configuration space with
ten robots. The final certification spends steps too but is never refused any.
"""

from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar

STEPS = 150
_left: ContextVar[list[int] | None] = ContextVar("left", default=None)


@contextmanager
def search_budget() -> Generator[None]:
    """Let all searches in this context share one budget; a nested context shares the outer one."""
    if _left.get() is not None:
        yield
        return
    token = _left.set([STEPS])
    try:
        yield
    finally:
        _left.reset(token)


def spend(steps: int) -> None:
    """Spend steps of the current budget, if there is one."""
    left = _left.get()
    if left is not None:
        left[0] -= steps


def cut_short() -> bool:
    """Return whether the budget is spent, so that a search has to end."""
    left = _left.get()
    return left is not None and left[0] <= 0
