"""Messages of a conversation as frozen values; the history of them is all the state there is.

A history that ends in calls without results is a paused run: whoever continues it answers them.
"""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, field_validator
from pydantic_core import to_json

ErrorKind = Literal["unknown_tool", "arguments", "tool", "timeout", "refused", "skipped"]
"""unknown_tool: no such tool; arguments: they violate its schema; tool: it could not do what was
asked; timeout: it took too long; refused: it may not be called, or a person said no; skipped:
robots were not moved because an earlier call in the same reply failed."""


class _Value(BaseModel):
    model_config = ConfigDict(
        frozen=True, extra="forbid", ser_json_bytes="base64", val_json_bytes="base64"
    )


class Call(_Value):
    """A model's request to run a tool."""

    id: str
    name: str
    arguments: dict[str, Any]

    @field_validator("arguments")
    @classmethod
    def _can_be_written(cls, arguments: dict[str, Any]) -> dict[str, Any]:
        """Refuse arguments that cannot be stored: endless nesting, or text that is not Unicode."""
        to_json(arguments)
        return arguments


class Usage(_Value):
    """What one request cost; zero where nothing is counted.

    Attributes:
        input_tokens: all input tokens.
        cached_tokens: those input tokens that the provider read from its cache.
    """

    input_tokens: int = 0
    cached_tokens: int = 0
    output_tokens: int = 0
    cost_usd: float = 0.0


class User(_Value):
    """What the person says; images are PNG or JPEG files."""

    role: Literal["user"] = "user"
    text: str
    images: tuple[bytes, ...] = ()


class Opaque(_Value):
    """The part of a reply stored as its server wrote it: signed or encrypted thoughts, odd ids.

    It is sent back to the model it came from, which may refuse the conversation without it; no
    other model and nothing else reads it.

    Attributes:
        model: the model it came from, such as gemini:NAME, with its address if that is not the
            provider's own.
        items: what is sent back beside text and calls; empty where only ids have to be preserved.
    """

    model: str
    items: tuple[dict[str, Any], ...]


class Reply(_Value):
    """What the model says: text, calls, or both; without calls the turn is over."""

    role: Literal["assistant"] = "assistant"
    text: str = ""
    calls: tuple[Call, ...] = ()
    usage: Usage = Usage()
    opaque: Opaque | None = None


class Aside(_Value):
    """A question that a running tool put to the model, and the reply, which counts in the turn."""

    text: str
    reply: Reply


class Result(_Value):
    """A tool's answer to one call.

    Attributes:
        error: the kind of error it reports, if any.
        cause: the kind of the tool's own error, which code reacts to; see `tools.errors.Kind`.
        facts: that error's numbers and ids; without an error, `plan_id` of the plan that was made.
        message: the message to the person, if the call has ended the turn.
        asides: what the tool asked the model, with the replies.
    """

    role: Literal["tool"] = "tool"
    call_id: str
    name: str
    text: str
    error: ErrorKind | None = None
    cause: str | None = None
    facts: dict[str, Any] | None = None
    images: tuple[bytes, ...] = ()
    message: str | None = None
    asides: tuple[Aside, ...] = ()


Message = User | Reply | Result
History = tuple[Message, ...]
HISTORY: TypeAdapter[History] = TypeAdapter(
    tuple[Annotated[Message, Field(discriminator="role")], ...]
)
"""Reads and writes a history as JSON: HISTORY.dump_json(history), HISTORY.validate_json(text)."""


def unanswered(history: Sequence[Message]) -> tuple[Call, ...]:
    """Return the calls of the last reply that have no result yet, in order."""
    answered: set[str] = set()
    for message in reversed(history):
        if isinstance(message, Result):
            answered.add(message.call_id)
        elif isinstance(message, Reply):
            return tuple(call for call in message.calls if call.id not in answered)
        else:
            break
    return ()


def failed_before(history: Sequence[Message]) -> str | None:
    """Return the name of the last failed call among the answered calls of the last reply."""
    for message in reversed(history):
        if isinstance(message, Result) and message.error:
            return message.name
        if not isinstance(message, Result):
            break
    return None


def plan_of_reply(history: Sequence[Message]) -> str | None:
    """Return the id of the plan made last by the answered calls of the last reply, or None."""
    for message in reversed(history):
        if not isinstance(message, Result):
            break
        if not message.error and message.facts:
            return message.facts.get("plan_id")
    return None


def known_doubts(history: Sequence[Message]) -> frozenset[str]:
    """Return the doubts of this turn that the model knew of when it gave its last reply."""
    turn = turn_of(history)
    last = max((i for i, m in enumerate(turn) if isinstance(m, Reply)), default=0)
    told = (m for m in turn[:last] if isinstance(m, Result) and m.cause == "doubt")
    return frozenset(doubt for m in told for doubt in (m.facts or {}).get("doubts", ()))


def replies_of(messages: Sequence[Message]) -> list[Reply]:
    """Return the model's replies, including those to tools' questions."""
    found: list[Reply] = []
    for m in messages:
        found += [m] if isinstance(m, Reply) else []
        found += [a.reply for a in m.asides] if isinstance(m, Result) else []
    return found


def turn_of(history: Sequence[Message]) -> Sequence[Message]:
    """Return the messages of the last turn, which begins with the person's last message."""
    for place in range(len(history) - 1, -1, -1):
        if isinstance(history[place], User):
            return history[place:]
    return history


MOST_FAILING, MOST_ALIKE = 2, 3
"""A turn is stopped once a call has failed the same way in so many replies, or has had the same
answer so many times."""


def is_repeated(history: Sequence[Message]) -> bool:
    """Return whether the last result shows that the model goes in circles in this turn.

    That is, the same call (name and arguments) had the same answer too often.
    """
    last = history[-1]
    if not isinstance(last, Result) or last.error == "skipped":
        return False
    turn = turn_of(history)
    alike = {
        m.call_id
        for m in turn
        if isinstance(m, Result) and (m.text, m.name) == (last.text, last.name)
    }
    if len(alike) == 1:
        return False
    replies = [[c for c in m.calls if c.id in alike] for m in turn if isinstance(m, Reply)]
    now = next(c.arguments for calls in replies for c in calls if c.id == last.call_id)
    same = [n for n in (sum(c.arguments == now for c in calls) for calls in replies) if n]
    return sum(same) >= MOST_ALIKE or (bool(last.error) and len(same) >= MOST_FAILING)


def closed(history: History, why: str) -> History:
    """Return the history with a result for each call that has none, as providers demand."""
    return (*history, *(_unanswered_result(call, why) for call in unanswered(history)))


LOST = "No result: it was broken off before one came, so that what it did is not known."


def paired(history: Sequence[Message]) -> History:
    """Return the history with each call answered once and right away, as every provider demands.

    Calls that a kill left without a result get one that says so, except those at the end, which
    may still be answered; results without a call, or for an answered one, are left out.
    """
    made: list[Message] = []
    waiting: dict[str, Call] = {}
    for message in history:
        if isinstance(message, Result):
            if waiting.pop(message.call_id, None) is None:
                continue
        else:
            made += (_unanswered_result(call, LOST) for call in waiting.values())
            waiting = {c.id: c for c in message.calls} if isinstance(message, Reply) else {}
        made.append(message)
    return tuple(made)


def _unanswered_result(call: Call, why: str) -> Result:
    return Result(call_id=call.id, name=call.name, text=why, error="refused")
