"""Clients send whole histories: where each goes on, and that nothing is done twice."""

import asyncio
import re
import threading
from collections.abc import Callable
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Reply
from formup.agent.store.protocol import Store
from formup.apps.server import openai_places
from openai import NotFoundError

CAGE = "Cage the largest coin with 10 robots"
OURS = re.compile(r"(!\[[^]]*\]\(|\[formup\]: )http\S+")
Serve = Callable[..., str]


def session_of(answer: str) -> str:
    return re.findall(r"/v1/pictures/([\w-]+)/", answer)[-1]


def turns(store: Store) -> dict[str, list[str]]:
    """What was said in each session."""
    return {
        s.id: [e.data["words"] for e in store.open(s.id).events() if e.kind == "turn"]
        for s in store.sessions()
    }


def test_the_same_request_is_done_once_even_by_another_process(
    serve: Serve, chat: Any, store: Store
) -> None:
    url = serve()
    talk = chat(url)
    first = talk.say(CAGE, "us_coins.jpg")
    further = talk.say("a bit further out")
    gone = talk.say("go")
    for process in range(2):
        url = serve() if process else url
        for count, answer in ((1, first), (3, further), (5, gone)):
            again = chat(url, messages=talk.messages[:count])
            assert OURS.sub("", again.again()) == OURS.sub("", answer)
            assert session_of(again.messages[-1]["content"]) == session_of(first)
    assert turns(store) == {session_of(first): [CAGE, "a bit further out", "go"]}


def test_a_first_message_is_another_session_after_a_while(
    serve: Serve, chat: Any, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    url = serve()
    first = chat(url).say(CAGE, "us_coins.jpg")
    assert session_of(chat(url).say(CAGE, "us_coins.jpg")) == session_of(first)
    assert session_of(chat(url).say(CAGE, "us_coins.jpg", user="bob")) != session_of(first)
    monkeypatch.setattr(openai_places, "SAME", openai_places.SAME * 0)
    assert session_of(chat(url).say(CAGE, "us_coins.jpg")) != session_of(first)
    assert len(turns(store)) == 3


def test_the_same_message_twice_at_once_is_one_turn(serve: Serve, chat: Any, store: Store) -> None:
    url = serve()
    talks = [chat(url) for _ in range(4)]
    threads = [threading.Thread(target=t.say, args=(CAGE, "us_coins.jpg")) for t in talks]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [*turns(store).values()] == [[CAGE]]
    assert len({t.messages[-1]["content"] for t in talks}) == 1


def test_an_edited_message_goes_on_in_a_fork(serve: Serve, chat: Any, store: Store) -> None:
    url = serve()
    talk = chat(url)
    first = talk.say(CAGE, "us_coins.jpg")
    further = talk.say("a bit further out")
    edited = chat(url, messages=talk.messages[:2])
    closer = edited.say("a bit closer")
    assert session_of(closer) != session_of(first) == session_of(further)
    again = chat(url, messages=edited.messages[:-1])
    assert again.again() == closer, "sent again, it is the same fork"
    del edited.messages[-1]  # its answer is lost
    edited.say("undo")
    talk.say("undo")
    assert sorted(turns(store).values()) == [
        [CAGE, "a bit closer", "undo"],
        [CAGE, "a bit further out", "undo"],
    ]


def test_another_answer_to_a_question_forks_at_the_question(
    serve: Serve, chat: Any, store: Store
) -> None:
    url = serve()
    talk = chat(url)
    talk.say(CAGE, "us_coins.jpg")
    question = talk.say("surround the other coin")
    assert "Which one" in question
    second = talk.say("the second one")
    other = chat(url, messages=talk.messages[:4])
    first = other.say("number 5")
    assert "certified" in first
    assert session_of(first) != session_of(second)
    assert OURS.sub("", first) != OURS.sub("", second)


def test_what_was_said_while_the_answer_was_lost_is_not_said_again(
    serve: Serve, chat: Any, store: Store
) -> None:
    """The client cut the stream of "go", and keeps it in its history without an answer."""
    talk = chat(serve())
    session = session_of(talk.say(CAGE, "us_coins.jpg"))
    talk.say("go")
    del talk.messages[-1]
    assert "all stand at their places" in talk.say("are they there?")
    assert turns(store) == {session: [CAGE, "go", "are they there?"]}


def test_histories_without_our_addresses_are_known_by_what_was_said(
    serve: Serve, chat: Any, store: Store
) -> None:
    def stripped(talk: Any) -> None:
        for message in talk.messages:
            if message["role"] == "assistant":
                message["content"] = OURS.sub("", message["content"])

    talk = chat(serve())
    session = session_of(talk.say(CAGE, "us_coins.jpg"))
    for words in ("a bit further out", "a bit further out", "go"):
        stripped(talk)
        assert session_of(talk.say(words)) == session
    assert turns(store) == {session: [CAGE, "a bit further out", "a bit further out", "go"]}
    stripped(talk)
    talk.messages[2:] = [{"role": "user", "content": "a bit closer"}]
    talk.again()
    assert turns(store)[session_of(talk.messages[-1]["content"])] == [CAGE, "a bit closer"]


@pytest.mark.parametrize("how", ["header", "metadata", "X-OpenWebUI-Chat-Id"])
def test_a_client_may_name_its_chat(serve: Serve, chat: Any, store: Store, how: str) -> None:
    talk = chat(serve())
    named: dict[str, Any] = {"extra_headers": {how: "chat-7"}}
    if how == "metadata":
        named = {"metadata": {"chat_id": "chat-7"}}
    session = session_of(talk.say(CAGE, "us_coins.jpg", **named))
    if how == "header":
        named = {"extra_headers": {"X-Formup-Session": session}}
    for words in ("a bit further out", "a bit further out"):
        talk.messages.clear()  # a client that sends nothing but the last message
        assert session_of(talk.say(words, **named)) == session
    assert turns(store) == {session: [CAGE, "a bit further out", "a bit further out"]}
    if how != "header":
        talk.messages.clear()
        assert (
            session_of(talk.say("Cage the largest coin with 9 robots", "us_coins.jpg", **named))
            != session
        )


@pytest.mark.parametrize("keeps", ["nothing", "words", "all"])
def test_chats_that_begin_alike_stay_apart(
    serve: Serve, chat: Any, store: Store, keeps: str
) -> None:
    """One token and one first message, from clients that keep different parts of a history."""

    def say(talk: Any, name: str, words: str, picture: str | None = None) -> str:
        if keeps == "nothing":
            talk.messages.clear()
        for message in talk.messages if keeps == "words" else ():
            if message["role"] == "assistant":
                message["content"] = OURS.sub("", message["content"])
        named = {"metadata": {"chat_id": name}} if name else {}
        return session_of(talk.say(words, picture, **named))

    url = serve()
    talks = {name: chat(url) for name in ("one", "two", "")}
    found = {name: say(talk, name, CAGE, "us_coins.jpg") for name, talk in talks.items()}
    assert len({*found.values()}) == 3
    if keeps == "nothing":
        del talks[""]  # it needs a name, or a history
    said = {name: [CAGE] for name in found}
    for words in ("a bit further out", "undo"):
        for name, talk in talks.items():
            assert say(talk, name, words) == found[name]
            said[name].append(words)
    assert turns(store) == {found[name]: words for name, words in said.items()}


def test_an_edited_message_forks_from_what_was_said_longest(
    serve: Serve, chat: Any, store: Store
) -> None:
    """A chat with a name and a history without addresses goes on where it was, not in a fork."""
    talk, named = chat(serve()), {"metadata": {"chat_id": "chat-7"}}
    session = session_of(talk.say(CAGE, "us_coins.jpg", **named))
    talk.messages = [m for m in talk.messages if m["role"] == "user"]
    talk.say("a bit further out", **named)
    talk.messages = [m for m in talk.messages if m["role"] == "user"]
    edited = chat(str(talk.client.base_url).removesuffix("/v1/"), messages=talk.messages[:1])
    assert session_of(edited.say("a bit closer", **named)) != session
    assert session_of(talk.say("undo", **named)) == session
    assert sorted(turns(store).values()) == [
        [CAGE, "a bit closer"],
        [CAGE, "a bit further out", "undo"],
    ]


def test_a_chat_copied_under_another_name_goes_on_in_a_session_of_its_own(
    serve: Serve, chat: Any, store: Store
) -> None:
    talk = chat(url := serve())
    first = session_of(talk.say(CAGE, "us_coins.jpg", metadata={"chat_id": "one"}))
    copied = chat(url, messages=talk.messages)
    second = session_of(copied.say("a bit closer", metadata={"chat_id": "two"}))
    assert session_of(talk.say("a bit closer", metadata={"chat_id": "one"})) == first != second
    for name, session in (("one", first), ("two", second)):
        alone = chat(url).say("undo", metadata={"chat_id": name})
        assert session_of(alone) == session
    assert turns(store) == {s: [CAGE, "a bit closer", "undo"] for s in (first, second)}


@pytest.mark.parametrize("named", [{}, {"metadata": {"chat_id": "one"}}])
def test_a_chat_goes_on_in_its_session_when_that_is_renamed(
    serve: Serve, chat: Any, store: Store, named: dict[str, Any]
) -> None:
    talk = chat(serve())
    session = session_of(talk.say(CAGE, "us_coins.jpg", **named))
    store.rename(session, "coins on Monday")
    talk.messages = [m for m in talk.messages if m["role"] == "user"]
    assert session_of(talk.say("a bit further out", **named)) == session
    assert turns(store) == {session: [CAGE, "a bit further out"]}
    assert store.sessions()[0].name.startswith("coins on Monday [")


def test_a_session_that_was_deleted_is_told(serve: Serve, chat: Any, store: Store) -> None:
    talk = chat(serve())
    session = session_of(talk.say(CAGE, "us_coins.jpg"))
    store.delete(session)
    with pytest.raises(NotFoundError, match="no longer exists; begin a new chat"):
        talk.say("a bit further out")


def test_a_turn_goes_on_when_its_client_has_gone(
    serve: Serve, chat: Any, sent: Any, store: Store
) -> None:
    asked, answered = threading.Event(), threading.Event()

    class Slow:
        name = "slow"

        async def reply(self, request: object) -> Reply:
            asked.set()
            while not answered.is_set():
                await asyncio.sleep(0.01)
            return Reply(text="Nothing to do.")

    url = serve(Agent(Slow()))
    talk = chat(url, messages=[sent(CAGE, "us_coins.jpg")])
    stream = talk.client.chat.completions.create(
        model="formup", messages=talk.messages, stream=True
    )
    next(iter(stream))
    assert asked.wait(10)
    stream.close()
    impatient = chat(url, messages=talk.messages)
    assert "I am still working on your last message" in impatient.say("and now?")
    answered.set()
    assert "Nothing to do." in chat(url, messages=talk.messages).again()
    assert [*turns(store).values()] == [[CAGE]]
