"""Bounds of a turn. Reaching one is an outcome like any other: the messages are all there."""

from dataclasses import dataclass, fields

from pydantic import ConfigDict

from ..tools.errors import InputError
from .messages import History, Result, replies_of, turn_of


@dataclass(frozen=True)
class Limits:
    """What a turn may use; None is no limit.

    Tokens and cost are checked before each request, so that the last one may go over; seconds
    count from where the turn was begun or resumed, and stand still while robots drive.

    Attributes:
        requests: to the model.
        tool_calls: all tools together, checked before each call.
        tokens: input and output together.
        cost_usd: as far as prices are known.
        seconds: wall time; what runs then is interrupted.
        tool_seconds: of one tool call; robots that drive are not bound by it.
        reply_seconds: of one reply of the model, from the request to its end.

    Raises:
        InputError: one that is not above 0.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")  # where they are read from a log

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
    """The limit that the last turn has reached, as a sentence."""
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
    """The limit of tool calls, as a sentence, once it has been reached."""
    if limits.tool_calls is None:
        return None
    if sum(isinstance(m, Result) for m in turn_of(history)) < limits.tool_calls:
        return None
    return f"The limit of {_counted(limits.tool_calls, 'tool call')} was reached."


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
