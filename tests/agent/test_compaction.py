"""What of long conversations is sent: bounded, in steps, and nothing that counts is lost."""

import json
from typing import Any

import pytest
from formup.agent.compaction import STEP, WHOLE, compacted
from formup.agent.first_message import read_task
from formup.agent.messages import (
    LOST,
    Call,
    History,
    Message,
    Reply,
    Result,
    User,
    closed,
    paired,
    turn_of,
    unanswered,
)
from formup.benchmarks.bench_sessions import next_request, tokens
from hypothesis import given, settings
from hypothesis import strategies as st

PNG = b"\x89PNG"


def asked(number: int, words: str, standing: Any, *, shown: bool = False) -> User:
    lines: dict[str, Any] = {
        "Instruction": words,
        "Robots": None,
        "Picture": "200 x 140 px",
        "Pointed at": [],
        "Targets": [],
        "Deploy": True,
        "Standing": standing,
    }
    text = "\n".join(f"{name}: {json.dumps(value)}" for name, value in lines.items())
    return User(text=text, images=(PNG + bytes([number % 256]),) if shown else ())


words = st.text(st.characters(codec="utf-8"), max_size=60) | st.just("x" * 3_000)


@st.composite
def turns(draw: st.DrawFn, number: int, *, last: bool) -> list[Message]:
    """A turn: calls with results of any size, a question perhaps; the last may be unfinished."""
    standing = draw(st.none() | st.just({"plan": f"p-{number}", "contract": {"n": number}}))
    made: list[Message] = [
        asked(number, draw(words), standing, shown=number == 1 or draw(st.integers(0, 9)) == 0)
    ]
    for step in range(draw(st.integers(0, 3))):
        names = draw(st.lists(st.sampled_from(["look", "edit_formation", "ask_user"]), max_size=3))
        arguments = {"question": draw(words)}
        calls = tuple(
            Call(id=f"c{number}-{step}-{i}", name=name, arguments=arguments)
            for i, name in enumerate(names, start=1)
        )
        made.append(Reply(text=draw(words), calls=calls))
        for call in calls:
            images = (PNG * 100,) if call.name == "look" else ()
            facts = {"plan_id": f"p-{number}-{step}"} if call.name == "edit_formation" else None
            text = draw(words)
            made.append(
                Result(call_id=call.id, name=call.name, text=text, images=images, facts=facts)
            )
    if last and draw(st.booleans()):
        made.append(Reply(calls=(Call(id="open", name="ask_user", arguments={"question": "?"}),)))
    elif not last or draw(st.booleans()):
        made.append(Reply(text=draw(words)))
    return made


@st.composite
def dialogues(draw: st.DrawFn) -> History:
    count = draw(st.integers(1, 4 * STEP))
    return tuple(m for n in range(1, count + 1) for m in draw(turns(n, last=n == count)))


def pairs_are_strict(history: History) -> bool:
    """Whether each call has one result at once, and none is without a call."""
    waiting: set[str] = set()
    for message in history:
        if isinstance(message, Result):
            if message.call_id not in waiting:
                return False
            waiting.remove(message.call_id)
        elif waiting:
            return False
        if isinstance(message, Reply):
            waiting = {call.id for call in message.calls}
    return True


def starts(history: History) -> list[int]:
    return [i for i, message in enumerate(history) if isinstance(message, User)]


@settings(max_examples=60, deadline=None)
@given(dialogues())
def test_what_stands_and_what_is_asked_is_never_lost(history: History) -> None:
    sent = compacted(history)
    assert turn_of(sent) == turn_of(history)  # with the contract, the plan, an open question
    assert unanswered(sent) == unanswered(history)
    assert isinstance(sent[0], User)
    assert pairs_are_strict(sent)
    assert (
        read_task(turn_of(sent)[0].text).instruction
        == read_task(turn_of(history)[0].text).instruction
    )
    shown = [m.images for m in history if isinstance(m, User) and m.images]
    assert shown[0] in [m.images for m in sent if isinstance(m, User)] or len(shown) > 1
    if len(starts(history)) < STEP + WHOLE:
        assert sent == history


@settings(max_examples=30, deadline=None)
@given(dialogues())
def test_between_steps_a_request_only_extends_the_one_before(history: History) -> None:
    steps, before = 0, ()
    for end in range(1, len(history) + 1):
        sent = compacted(history[:end])
        if sent[: len(before)] != before:
            steps += 1
            assert isinstance(history[end - 1], User)
        before = sent
    count = len(starts(history))
    assert steps == max(0, (count - WHOLE) // STEP)


@settings(max_examples=30, deadline=None)
@given(dialogues(), st.integers(2, 60))
def test_however_long_it_is_bounded(history: History, times: int) -> None:
    whole = paired(closed(history, "over"))
    long = compacted(whole * times)
    turn_sizes = [tokens(tuple(whole[a:b])) for a, b in spans(whole)]
    assert tokens(long) <= (WHOLE + STEP) * max(turn_sizes) + 12 * 1_500
    assert len([m for m in long if isinstance(m, User)]) <= 2 * (WHOLE + STEP) + 4


def spans(history: History) -> list[tuple[int, int]]:
    places = starts(history)
    return list(zip(places, [*places[1:], len(history)], strict=True))


def dialogue(count: int) -> History:
    """Turns of one size, as an editing conversation has them."""
    made: list[Message] = []
    for n in range(1, count + 1):
        standing = {"plan": f"p-{n - 1}", "contract": {"groups": [{"relation": "around"}]}}
        call = Call(id=f"c{n}", name="edit_formation", arguments={"edits": [{"kind": "out"}]})
        text = json.dumps({"plan_id": f"p-{n}", "moves": [[i, 12.5] for i in range(30)]})
        result = Result(call_id=call.id, name=call.name, text=text, facts={"plan_id": f"p-{n}"})
        made += [asked(n, f"Turn {n}", standing), Reply(calls=(call,)), result]
        made.append(Reply(text=f"Done {n}."))
    return tuple(made)


def test_a_request_after_three_hundred_turns_weighs_what_the_tenth_did() -> None:
    history = dialogue(320)
    tenth = next_request(history, 10)
    for number in (*range(11, 60), *range(295, 321)):
        assert next_request(history, number) <= 1.3 * tenth


def test_the_first_turn_and_the_latest_are_told_and_how_many_are_left_out() -> None:
    sent = compacted(dialogue(40))
    told = [m.text for m in sent if isinstance(m, Reply)]
    assert told[0] == (
        "Done 1. (plan p-1)\n[27 later turns are left out here; undo reaches their plans.]"
    )
    assert told[1] == "Done 29. (plan p-29)"
    assert [m.text for m in sent if isinstance(m, User)][:2] == [
        'Instruction: "Turn 1"',
        'Instruction: "Turn 29"',
    ]


def test_old_pictures_go_first_and_the_one_talked_about_stays() -> None:
    look = Call(id="l", name="look", arguments={})
    shown = Result(call_id="l", name="look", text="y" * 1_000, images=(PNG,))
    history = tuple(
        m
        for n in range(1, 9)
        for m in (asked(n, "a", None, shown=n == 1), Reply(calls=(look,)), shown, Reply(text="b"))
    )
    sent = compacted(history)
    images = [len(m.images) for m in sent if isinstance(m, User | Result)]
    assert images == [1, 0, 0, 0, *(0, 0) * 2, *(0, 1) * 2]
    assert [len(m.text) for m in sent if isinstance(m, Result)] == [400, 400, 1_000, 1_000]
    another = asked(4, "this one", None, shown=True)
    sent = compacted((*history[:12], another, *history[13:]))
    assert [m.images for m in sent if isinstance(m, User) and m.images] == [another.images]


def test_an_answered_question_is_outlined_with_its_answer() -> None:
    call = Call(id="q", name="ask_user", arguments={"question": "How many?"})
    first = (asked(1, "Surround it", None), Reply(calls=(call,)))
    answered = Result(call_id="q", name="ask_user", text="nine", message="Nine stand there.")
    sent = compacted((*first, answered, *dialogue(9)))
    assert sent[0].text == 'Instruction: "Surround it"\nAsked "How many?", answered "nine".'
    assert sent[1].text == "Nine stand there."


A, B = (Call(id=i, name="look", arguments={}) for i in "ab")


def result(id: str, text: str = "seen") -> Result:
    return Result(call_id=id, name="look", text=text)


@pytest.mark.parametrize(
    ("history", "results"),
    [
        ((User(text="x"), Reply(calls=(A, B)), result("a"), User(text="y")), ["seen", LOST]),
        ((User(text="x"), Reply(calls=(A,)), Reply(text="z")), [LOST]),
        ((User(text="x"), Reply(calls=(A, B)), result("a")), ["seen"]),
        ((User(text="x"), result("a"), Reply(calls=(A,)), result("a"), result("a")), ["seen"]),
        ((User(text="x"), Reply(calls=(A,)), User(text="y"), result("a")), [LOST]),
        ((), []),
    ],
)
def test_calls_without_results_are_repaired(history: History, results: list[str]) -> None:
    whole = paired(history)
    assert [m.text for m in whole if isinstance(m, Result)] == results
    assert paired(whole) == whole
    assert pairs_are_strict(closed(whole, "over"))
    assert [m for m in whole if not isinstance(m, Result)] == [
        m for m in history if not isinstance(m, Result)
    ]


@settings(max_examples=60, deadline=None)
@given(dialogues(), st.data())
def test_whatever_is_missing_is_repaired(history: History, data: st.DataObject) -> None:
    gone = data.draw(st.sets(st.integers(0, len(history) - 1)))
    left = tuple(m for i, m in enumerate(history) if i not in gone or not isinstance(m, Result))
    assert pairs_are_strict(closed(paired(left), "over"))
    assert paired(history) == history
