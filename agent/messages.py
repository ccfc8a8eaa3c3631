"""Messages of a conversation as frozen values; the history of them is all the state there is.

A history that ends in calls without results is a paused run: whoever continues it answers them.
"""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, field_validator
from pydantic_core import to_json

ErrorKind = Literal["unknown_tool", "arguments", "tool", "timeout", "refused", "skipped"]
"""unknown_tool: no such tool; arguments: against its schema; tool: it could not do that;
timeout: it took too long; refused: it may not be called, or a person said no; skipped: robots are
not moved when a call before it in the same reply failed."""


class _Value(BaseModel):
    model_config = ConfigDict(
        frozen=True, extra="forbid", ser_json_bytes="base64", val_json_bytes="base64"
    )


class Call(_Value):
    """A model's wish to have a tool run."""

    id: str
    name: str
    arguments: dict[str, Any]

    @field_validator("arguments")
    @classmethod
    def _can_be_written(cls, arguments: dict[str, Any]) -> dict[str, Any]:
        """A history must always be storable: no endless nesting, no text that is not Unicode."""
        to_json(arguments)
        return arguments


class Usage(_Value):
    """What one request cost; zero where nothing is counted.

    Attributes:
        input_tokens: all of the input.
        cached_tokens: those of the input that the provider read from its cache.
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
    """What is kept of a reply as its server wrote it: thoughts, signed or encrypted, and odd ids.

    It goes back to the model it came from, which may refuse the conversation without; no other
    model and nothing else reads it.

    Attributes:
        model: whose it is, such as gemini:NAME, and where it was asked if not at its own address.
        items: what goes back beside text and calls; none where only ids have to stay as they are.
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
    """What a tool asked the model on its way, and the reply, which counts as one of the turn's."""

    text: str
    reply: Reply


class Result(_Value):
    """A tool's answer to one call.

    Attributes:
        error: what kind of mistake it reports, if any.
        cause: the kind of the tool's error, see `tools.errors.Kind`; what code reacts to.
        facts: that error's numbers and ids; else `plan_id`, of the plan that was made.
        message: what the person is told, where the call has ended the turn.
        asides: what the tool asked the model.
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
    """Calls of the last reply that have no result yet, in order."""
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
    """The name of the last call that failed among those of the last reply answered so far."""
    for message in reversed(history):
        if isinstance(message, Result) and message.error:
            return message.name
        if not isinstance(message, Result):
            break
    return None


def plan_of_reply(history: Sequence[Message]) -> str | None:
    """The id of the plan made last among the calls of the last reply answered so far."""
    for message in reversed(history):
        if not isinstance(message, Result):
            break
        if not message.error and message.facts:
            return message.facts.get("plan_id")
    return None


def doubts_told(history: Sequence[Message]) -> frozenset[str]:
    """The doubts that the model knew of when it gave its last reply, of this turn."""
    turn = turn_of(history)
    last = max((i for i, m in enumerate(turn) if isinstance(m, Reply)), default=0)
    told = (m for m in turn[:last] if isinstance(m, Result) and m.cause == "doubt")
    return frozenset(doubt for m in told for doubt in (m.facts or {}).get("doubts", ()))


def replies_of(messages: Sequence[Message]) -> list[Reply]:
    """The model's replies, to tools too."""
    found: list[Reply] = []
    for m in messages:
        found += [m] if isinstance(m, Reply) else []
        found += [a.reply for a in m.asides] if isinstance(m, Result) else []
    return found


def turn_of(history: Sequence[Message]) -> Sequence[Message]:
    """The messages of the last turn, which the person's last message began."""
    for place in range(len(history) - 1, -1, -1):
        if isinstance(history[place], User):
            return history[place:]
    return history


MOST_FAILING, MOST_ALIKE = 2, 3
"""Replies in which a call may fail in the same way, and times a call may have the same answer,
before the turn is stopped."""


def is_repeated(history: Sequence[Message]) -> bool:
    """Whether the last result shows a model that goes in circles, in this turn.

    That is: the same call, name and arguments, had the same answer so often.
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
    """The history with a result for each call that has none, so that any provider takes it."""
    return (*history, *(_unknown(call, why) for call in unanswered(history)))


LOST = "No result: it was broken off before one came, so that what it did is not known."


def paired(history: Sequence[Message]) -> History:
    """The history with each call answered once and at once, as every provider demands.

    Calls that a kill left without a result are given one that says so, but for those at the end,
    which may yet be answered; results of no call, or of one that is answered, are left out.
    """
    made: list[Message] = []
    waiting: dict[str, Call] = {}
    for message in history:
        if isinstance(message, Result):
            if waiting.pop(message.call_id, None) is None:
                continue
        else:
            made += (_unknown(call, LOST) for call in waiting.values())
            waiting = {c.id: c for c in message.calls} if isinstance(message, Reply) else {}
        made.append(message)
    return tuple(made)


def _unknown(call: Call, why: str) -> Result:
    return Result(call_id=call.id, name=call.name, text=why, error="refused")
