"""Limits of a turn. Reaching one is an outcome like any other, with all messages in it."""

from dataclasses import dataclass, fields

from pydantic import ConfigDict

from ..tools.errors import InputError
from .messages import History, Result, replies_of, turn_of


@dataclass(frozen=True)
class Limits:
    """What a turn may use; None is no limit.

    Tokens and cost are checked before each request, so the last one may exceed them; seconds
    count from when the turn was begun or resumed, and the clock stops while robots drive.

    Attributes:
        requests: requests to the model.
        tool_calls: calls of all tools together, checked before each call.
        tokens: input and output tokens together.
        cost_usd: cost, as far as prices are known.
        seconds: wall time; what is running when it is up is interrupted.
        tool_seconds: wall time of one tool call; tools that drive robots are exempt.
        reply_seconds: wall time of one model reply, from the request to its end.

    Raises:
        InputError: a limit is not above 0.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")  # for limits read from a log

    requests: int | None = 20
    tool_calls: int | None = 60
    tokens: int | None = None
    cost_usd: float | None = None
    seconds: float | None = None
    tool_seconds: float | None = 120.0
    reply_seconds: float | None = 300.0

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise InputError(f"A limit of {value:g} for {name} lets nothing run; give more.")


DEFAULT_LIMITS = Limits()


def exhausted(history: History, limits: Limits) -> str | None:
    """Return the limit that the last turn has reached as a sentence, or None."""
    replies = replies_of(turn_of(history))
    if limits.requests is not None and len(replies) >= limits.requests:
        return f"The limit of {_counted(limits.requests, 'request')} was reached."
    if reason := calls_exhausted(history, limits):
        return reason
    if limits.tokens is not None:
        used = sum(m.usage.input_tokens + m.usage.output_tokens for m in replies)
        if used >= limits.tokens:
            return f"The limit of {limits.tokens:,} tokens was reached: {used:,} were used."
    if limits.cost_usd is not None:
        spent = sum(m.usage.cost_usd for m in replies)
        if spent >= limits.cost_usd:
            return f"The limit of {limits.cost_usd:g} USD was reached: {spent:.4f} were spent."
    return None


def calls_exhausted(history: History, limits: Limits) -> str | None:
    """Return the limit of tool calls as a sentence if it has been reached, else None."""
    if limits.tool_calls is None:
        return None
    if sum(isinstance(m, Result) for m in turn_of(history)) < limits.tool_calls:
        return None
    return f"The limit of {_counted(limits.tool_calls, 'tool call')} was reached."


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
