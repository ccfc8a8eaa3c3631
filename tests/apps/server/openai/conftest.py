import base64
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from formup.agent.store.places import store_at
from formup.agent.store.protocol import Store
from openai import OpenAI
from openai.types.chat import ChatCompletion

PHOTOS = Path(__file__).parents[4] / "evals" / "photos" / "images"
Serve = Callable[..., str]


def data_url(name: str) -> str:
    kind = "png" if name.endswith("png") else "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode((PHOTOS / name).read_bytes()).decode()}"


@pytest.fixture
def serve(serve: Callable[..., Any]) -> Serve:
    """Begins a server beside those there are, on the same store; its address."""

    def begin(agent: Any = None, tokens: Path | None = None, **settings: Any) -> str:
        return serve(agent, tokens, **settings).url

    return begin


@pytest.fixture
def store(tmp_path: Path) -> Store:
    """What servers keep sessions in."""
    return store_at(f"sqlite:///{tmp_path}/s.db")


@pytest.fixture
def client() -> Generator[Callable[..., OpenAI]]:
    """OpenAI's own client of a server."""
    with ExitStack() as stack:

        def of(url: str, key: str = "none") -> OpenAI:
            made = OpenAI(base_url=f"{url}/v1", api_key=key, max_retries=0)
            return stack.enter_context(made)

        yield of


class Chat:
    """A chat client: keeps the history and sends all of it each time, as they do."""

    def __init__(self, client: OpenAI) -> None:
        self.client: Any = client  # its overloads are for options that are written out
        self.messages: list[Any] = []

    def say(self, words: str, picture: str | None = None, **options: Any) -> str:
        """One turn; the answer, checked against OpenAI's types."""
        self.messages.append(said(words, picture))
        return self.again(**options)

    def again(self, **options: Any) -> str:
        """The history as it is, sent and answered."""
        whole: ChatCompletion = self.client.chat.completions.create(
            model="formup", messages=self.messages, **options
        )
        assert ChatCompletion.model_validate_json(whole.model_dump_json(), strict=True)
        assert whole.choices[0].finish_reason == "stop"
        text = whole.choices[0].message.content
        assert text is not None
        self.messages.append({"role": "assistant", "content": text})
        return text


def said(words: str, picture: str | None = None) -> dict[str, Any]:
    if picture is None:
        return {"role": "user", "content": words}
    image = {"type": "image_url", "image_url": {"url": data_url(picture)}}
    text = [{"type": "text", "text": words}] if words else []
    return {"role": "user", "content": [*text, image]}


@pytest.fixture
def chat(client: Callable[..., OpenAI]) -> Callable[..., Chat]:
    """A chat with a server, perhaps with a token, perhaps with a history."""

    def begin(url: str, key: str = "none", messages: Sequence[Any] = ()) -> Chat:
        talk = Chat(client(url, key))
        talk.messages = list(messages)
        return talk

    return begin


@pytest.fixture
def sent() -> Callable[..., dict[str, Any]]:
    """Makes a person's message, perhaps with a photograph."""
    return said


@pytest.fixture
def photo() -> Callable[[str], str]:
    """A photograph as a data URL."""
    return data_url
