"""What chat programs ask for themselves reaches no robot, planner or session.

The requests are written after the prompts that the programs send.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from formup.agent.store.protocol import Store

RECORDED = json.loads((Path(__file__).parent / "recorded" / "chores.json").read_text("utf-8"))
CAGE = "Cage the largest coin with 10 robots"
ORDERS = (
    CAGE,
    "Put the robots in a circle, 12 words or less apart",
    "What is the title of this chat?",
    "Only return to the first plan",
    "Name the coins",
    "Suggest something",
    "Surround the tag with 5 robots",
    "Your task is to surround the coin with 5 robots",
)


def told(openai: Any, body: dict[str, Any]) -> str:
    """The answer, whether it is streamed or not."""
    if not body.get("stream"):
        return openai.chat.completions.create(**body).choices[0].message.content
    return "".join(c.choices[0].delta.content or "" for c in openai.chat.completions.create(**body))


def test_recorded_chores_are_answered_without_a_turn(
    serve: Callable[..., str], client: Any, store: Store
) -> None:
    openai = client(serve())
    for record in RECORDED:
        answer = told(openai, record["body"])
        wanted = record["answer"]
        read = answer if isinstance(wanted, str) else json.loads(answer)
        assert read == wanted, f"{record['client']}: {record['chore']}"
    assert store.sessions() == ()


def test_chores_leave_a_session_alone(serve: Callable[..., str], chat: Any, store: Store) -> None:
    talk = chat(serve())
    talk.say(CAGE, "us_coins.jpg")
    for record in RECORDED:
        # As Open WebUI sends it, with the whole history and without saying that it is a chore.
        messages = [*talk.messages, *record["body"]["messages"][-2:]]
        body = {k: v for k, v in record["body"].items() if k != "metadata"}
        told(talk.client, {**body, "messages": messages})
    (facts,) = store.sessions()
    assert facts.turns == 1
    assert "certified" in talk.say("a bit further out")


@pytest.mark.parametrize("system", ["", "Give each conversation a title. Be brief."])
def test_what_a_person_says_is_no_chore(
    serve: Callable[..., str], client: Any, system: str
) -> None:
    openai = client(serve())
    for words in ORDERS:
        messages: list[Any] = [{"role": "user", "content": words}]
        if system:
            messages.insert(0, {"role": "system", "content": system})
        named = {"task": "cage", "chat_id": ""}
        answer = told(openai, {"model": "formup", "messages": messages, "metadata": named})
        assert "I need a picture" in answer, words
