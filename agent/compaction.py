"""Shortens a long conversation for the model, so that its requests stay bounded.

The last turns are sent whole, earlier ones as request and outcome, most only as a count. This
changes in steps, between which a request only extends the one before, so provider caches hold. The
current plan and its contract are in each turn's first message, and so never lost.
"""

import json
from collections.abc import Sequence
from typing import Any

from .messages import History, Message, Reply, Result, User

STEP = 4
"""Number of turns after which older ones are shortened."""
WHOLE = 4
"""How many last turns are always sent: the last two in full, and once a step has passed the others
without pictures and with long results cut short."""
OUTLINED = 8
"""How many turns before those are sent as request and outcome, as is the very first one."""
LONGEST_RESULT, LONGEST_TEXT, LONGEST_WORDS = 400, 300, 200
"""Most characters sent of a result, of the answer to the person, and of the person's words."""


def compacted(history: History) -> History:
    """Return the conversation as it is sent to a model.

    Args:
        history: the whole conversation; its last turn stays exactly as it is.
    """
    turns = _turns_of(history)
    passed = max(0, (len(turns) - WHOLE) // STEP * STEP)
    if not passed:
        return history
    thinned = passed + WHOLE - 2
    shown = max((i for i in range(thinned) if _pictures(turns[i])), default=None)
    left_out = range(1, max(1, passed - OUTLINED))
    made: list[Message] = []
    for place, turn in enumerate(turns[:thinned]):
        if place in left_out and place != shown:
            continue
        pictures = _pictures(turn) if place == shown else ()
        made += _outlined(turn, pictures) if place < passed else _thinned(turn, pictures)
        if place == 0 and left_out:
            made[-1] = _followed_by(made[-1], len(left_out))
    return (*made, *(message for turn in turns[thinned:] for message in turn))


def _turns_of(history: History) -> list[list[Message]]:
    """Return the messages by turns, each of which begins with a message of the person."""
    turns: list[list[Message]] = [[]]
    for message in history:
        if isinstance(message, User) and turns[-1]:
            turns.append([])
        turns[-1].append(message)
    return turns


def _pictures(turn: Sequence[Message]) -> tuple[bytes, ...]:
    """Return the images of the person's message: the picture the conversation is about."""
    return turn[0].images if turn and isinstance(turn[0], User) else ()


def _thinned(turn: Sequence[Message], pictures: tuple[bytes, ...]) -> list[Message]:
    """Return a turn with long results cut short, and no images but `pictures` at its start."""
    made: list[Message] = []
    for message in turn:
        if isinstance(message, Result):
            shorter = {"text": _cut(message.text, LONGEST_RESULT), "images": ()}
            message = message.model_copy(update=shorter)
        elif isinstance(message, User):
            message = message.model_copy(update={"images": pictures})
        made.append(message)
    return made


def _outlined(turn: Sequence[Message], pictures: tuple[bytes, ...]) -> list[Message]:
    """Return a turn as two messages: what was asked, and what came of it."""
    calls = {c.id: c for m in turn if isinstance(m, Reply) for c in m.calls}
    asked = [_words(m.text) for m in turn if isinstance(m, User)]
    told, plan = "", None
    for message in turn:
        if isinstance(message, Result):
            told = message.message or told
            plan = (message.facts or {}).get("plan_id", plan)
            if message.name == "ask_user" and not message.error and message.call_id in calls:
                question = calls[message.call_id].arguments.get("question", "")
                asked.append(f"Asked {_in_quotes(question)}, answered {_in_quotes(message.text)}.")
        elif isinstance(message, Reply):
            told = message.text or told
    told = _cut(told, LONGEST_TEXT) or "This came to no end."
    if plan is not None and str(plan) not in told:
        told += f" (plan {plan})"
    return [User(text="\n".join(asked), images=pictures), Reply(text=told)]


def _followed_by(message: Message, turns: int) -> Message:
    """Return a message with a note on how many turns after it are left out."""
    text = f"{message.text}\n[{turns} later turns are left out here; undo reaches their plans.]"
    return message.model_copy(update={"text": text})


def _words(text: str) -> str:
    """Return the person's words from a turn's first message."""
    lines = text.split("\n")
    return _cut(next((s for s in lines if s.startswith("Instruction: ")), text), LONGEST_WORDS)


def _in_quotes(text: Any) -> str:
    return json.dumps(_cut(str(text), LONGEST_WORDS), ensure_ascii=False)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 4]} ..."
