"""The Responses API, through OpenAI's own client and its strict types."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Reply
from formup.agent.store.protocol import Store
from openai import NotFoundError, UnprocessableEntityError
from openai.types.responses import Response, ResponseStreamEvent
from pydantic import TypeAdapter

CAGE = "Cage the largest coin with 10 robots"
ORDER = [
    "response.created",
    "response.in_progress",
    "response.output_item.added",
    "response.content_part.added",
    "response.output_text.delta",
    "response.output_text.done",
    "response.content_part.done",
    "response.output_item.done",
    "response.completed",
]
Serve = Callable[..., str]


@pytest.fixture
def caged(photo: Callable[[str], str]) -> list[Any]:
    """The input of a first response."""
    image = {"type": "input_image", "image_url": photo("us_coins.jpg"), "detail": "auto"}
    return [{"role": "user", "content": [{"type": "input_text", "text": CAGE}, image]}]


def checked(response: Response) -> Response:
    Response.model_validate_json(response.model_dump_json(), strict=True)
    assert response.status == "completed"
    return response


def test_responses_follow_each_other(
    serve: Serve, client: Any, caged: list[Any], store: Store
) -> None:
    openai = client(serve())
    first = checked(openai.responses.create(model="formup", input=caged, store=True))
    assert "10 robots have certified" in first.output_text
    further = checked(
        openai.responses.create(
            model="formup", input="a bit further out", previous_response_id=first.id
        )
    )
    asked = {"model": "formup", "input": "undo", "previous_response_id": further.id}
    undone = checked(openai.responses.create(**asked))
    assert "Back: plan" in undone.output_text
    assert openai.responses.create(**asked).id == undone.id, "it is done once"
    for given in (first, further, undone):
        kept = checked(openai.responses.retrieve(given.id))
        assert (kept.id, kept.output_text) == (given.id, given.output_text)
    other = checked(
        openai.responses.create(model="formup", input="a bit closer", previous_response_id=first.id)
    )
    assert other.id.split("_")[1] != first.id.split("_")[1], "a fork"
    assert sorted(s.turns for s in store.sessions()) == [2, 3]


def test_events_come_in_their_order(serve: Serve, client: Any, caged: list[Any]) -> None:
    openai = client(serve())
    events = list(openai.responses.create(model="formup", input=caged, stream=True))
    adapter: TypeAdapter[Any] = TypeAdapter(ResponseStreamEvent)
    for number, event in enumerate(events):
        adapter.validate_json(event.model_dump_json(), strict=True)
        assert event.sequence_number == number
    assert [event.type for event in events] == ORDER
    done = checked(events[-1].response)
    assert events[0].response.id == done.id
    with openai.responses.stream(
        model="formup", input="a bit further out", previous_response_id=done.id
    ) as stream:
        assert "certified" in stream.get_final_response().output_text


def test_a_failure_ends_the_stream_as_one(serve: Serve, client: Any, caged: list[Any]) -> None:
    class Broken:
        name = "broken"

        async def reply(self, request: object) -> Reply:
            await asyncio.sleep(0.3)
            raise RuntimeError("secret")

    openai = client(serve(Agent(Broken())))
    with openai.responses.with_streaming_response.create(
        model="formup", input=caged, stream=True
    ) as raw:
        lines = [line for line in raw.iter_lines() if line]
    assert [line for line in lines if line.startswith("event:")][-2:] == [
        "event: error",
        "event: response.failed",
    ]
    assert "secret" not in "".join(lines)


def test_a_picture_alone_is_kept_for_the_next_response(
    serve: Serve, client: Any, caged: list[Any]
) -> None:
    openai = client(serve())
    alone = [{**caged[0], "content": [p for p in caged[0]["content"] if p["type"] != "input_text"]}]
    asks = checked(openai.responses.create(model="formup", input=alone))
    assert "I have the picture" in asks.output_text
    assert checked(openai.responses.retrieve(asks.id)).output_text == asks.output_text
    caging = openai.responses.create(model="formup", input=CAGE, previous_response_id=asks.id)
    assert "10 robots have certified" in checked(caging).output_text


def test_what_is_not_there_is_told(serve: Serve, client: Any, caged: list[Any]) -> None:
    openai = client(serve())
    asks = checked(openai.responses.create(model="formup", input="Hello"))
    assert "I need a picture" in asks.output_text
    with pytest.raises(NotFoundError, match="was not kept"):
        openai.responses.retrieve(asks.id)
    follows = openai.responses.create(model="formup", input=caged, previous_response_id=asks.id)
    assert "certified" in checked(follows).output_text
    for id in ("resp_abc", "resp_0123456789_4", "x"):
        with pytest.raises(NotFoundError):
            openai.responses.create(model="formup", input="go", previous_response_id=id)
        with pytest.raises(NotFoundError):
            openai.responses.retrieve(id)
    file = [{"role": "user", "content": [{"type": "input_image", "file_id": "f-1"}]}]
    with pytest.raises(UnprocessableEntityError, match="this server fetches nothing"):
        openai.responses.create(model="formup", input=file, previous_response_id=follows.id)
