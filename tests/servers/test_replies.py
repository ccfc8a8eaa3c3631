"""Turns of a conversation with servers that others wrote: what formup makes of them."""

from io import BytesIO
from typing import Any

import pytest
from formup.agent.messages import Call, Reply, Result, User
from PIL import Image

SENTENCE = "Six robots have a place."
BOX = [55, 35, 125, 95]
PERSON = User(text="Surround the red thing with 6 robots")
CALLED = Reply(calls=(Call(id="c1", name="propose_formation", arguments={"contract": {}}),))
BOTH = Reply(
    text="I look.",
    calls=(
        Call(id="a", name="look", arguments={"candidates": True}),
        Call(id="b", name="measure", arguments={}),
    ),
)


def png() -> bytes:
    file = BytesIO()
    Image.new("RGB", (40, 30), (200, 40, 40)).save(file, "PNG")
    return file.getvalue()


def result(**more: Any) -> Result:
    return Result(call_id="c1", name="propose_formation", text="{}", **more)


def check_call(reply: Reply) -> None:
    (call,) = reply.calls
    assert call.name == "propose_formation"
    assert call.arguments["targets"][0]["box"] == BOX
    assert call.arguments["contract"]["groups"][0]["robots"] == 6
    assert call.id
    assert reply.text == ""


def test_a_person_gets_a_call(asked: Any, streamed: bool) -> None:
    check_call(asked.reply(asked.model(streamed=streamed), PERSON))


def test_a_result_gets_a_sentence(asked: Any, streamed: bool) -> None:
    reply = asked.reply(asked.model(streamed=streamed), PERSON, CALLED, result())
    assert (reply.text, reply.calls) == (SENTENCE, ())
    if streamed:
        assert "".join(asked.shown) == SENTENCE
        assert len(asked.shown) > 1


DONE = (
    BOTH,
    Result(call_id="a", name="look", text="{}"),
    Result(call_id="b", name="measure", text="b: is missing.", error="arguments"),
)
HISTORIES = {
    "mistake": (PERSON, CALLED, result(error="arguments")),
    "two calls": (PERSON, *DONE),
    "second turn": (PERSON, CALLED, result(), Reply(text=SENTENCE), User(text="Wider"), *DONE),
}


@pytest.mark.parametrize("history", HISTORIES.values(), ids=HISTORIES)
def test_longer_histories_are_taken(asked: Any, streamed: bool, history: Any) -> None:
    assert asked.reply(asked.model(streamed=streamed), *history).text == SENTENCE


def test_a_call_of_its_own_comes_back_to_it(asked: Any, streamed: bool) -> None:
    model = asked.model(streamed=streamed)
    first = asked.reply(model, PERSON)
    answer = Result(call_id=first.calls[0].id, name=first.calls[0].name, text="{}")
    assert asked.reply(model, PERSON, first, answer).text == SENTENCE


def test_an_image_from_a_person(asked: Any, streamed: bool) -> None:
    picture = User(text="Surround it", images=(png(),))
    check_call(asked.reply(asked.model(streamed=streamed), picture))


def test_an_image_in_a_result(asked: Any, streamed: bool) -> None:
    reply = asked.reply(asked.model(streamed=streamed), PERSON, CALLED, result(images=(png(),)))
    if asked.place.moves_images:
        check_call(reply)
    else:
        assert reply.text == SENTENCE


def test_tokens_are_counted(asked: Any, streamed: bool) -> None:
    usage = asked.reply(asked.model(streamed=streamed), PERSON, CALLED, result()).usage
    assert usage.cost_usd == 0  # a price that nobody listed
    if streamed and not asked.place.counts_streams:
        assert usage.output_tokens == 0
        return
    assert usage.input_tokens > 1_000  # words of the prompt and the tools
    assert usage.output_tokens == 4  # pieces of the sentence, and its end
