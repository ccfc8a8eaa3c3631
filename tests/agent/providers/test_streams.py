"""Streams of anything: fragments are read by hand, so whatever comes must end as an AskError."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise
from math import inf, nan
from typing import Any, cast

import pytest
from formup.agent.messages import User
from formup.agent.model import Request
from formup.agent.providers.anthropic import Anthropic
from formup.agent.providers.failures import AskError
from formup.agent.providers.gemini import Gemini
from formup.agent.providers.openai_chat import OpenAIChat
from formup.agent.providers.openai_responses import OpenAIResponses
from formup.agent.providers.prices import UNKNOWN
from formup.agent.providers.transport import Events
from formup.tools.builtin import TOOLS
from hypothesis import given, settings
from hypothesis import strategies as st

WIRES = [OpenAIChat, OpenAIResponses, Anthropic, Gemini]
WORDS = """
type index delta text partial_json stop_reason content_block message usage choices finish_reason
content refusal tool_calls id function name arguments input candidates parts functionCall args
thought thoughtSignature promptFeedback response output item error status incomplete_details
content_block_delta content_block_start message_start message_delta message_stop tool_use stop
response.completed response.output_text.delta response.output_item.done function_call output_text
finishReason STOP summary encrypted_content reasoning delta usageMetadata
"""
LEAVES = (
    st.none()
    | st.booleans()
    | st.integers(-2, 3)
    | st.floats()
    | st.sampled_from(WORDS.split())
    | st.text(max_size=3)
)
ANY = st.recursive(
    LEAVES,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(WORDS.split()), inner, min_size=1, max_size=5)
    ),
    max_leaves=25,
)
REQUEST = Request("", (User(text="go"),), TOOLS)


@pytest.mark.parametrize("wire", WIRES)
@given(events=st.lists(ANY, min_size=1, max_size=4))
def test_any_stream_is_a_reply_or_an_ask_error(wire: Any, events: list[Any]) -> None:
    spoken = wire("m", UNKNOWN)
    assembly = spoken.assembly()
    with suppress(AskError):
        for event in events:
            assert isinstance(assembly.add(event), str)
        spoken.reply(assembly.whole(), REQUEST)


ODD = [None, True, 0, -1, 2.5, inf, -inf, nan, 10**400, "", "x", [], [1], [None], {}, {"x": 1}]
SPOKEN = dict(zip(("openai", "openai-responses", "anthropic", "gemini"), WIRES, strict=True))


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Everywhere within a value: what holds something, and under which key."""
    if isinstance(value, dict | list):
        held = cast("dict[Any, Any] | list[Any]", value)
        for key in held if isinstance(held, dict) else range(len(held)):
            yield held, key
            yield from places(held[key])


@pytest.mark.parametrize("odd", ODD, ids=lambda odd: repr(odd)[:9])
def test_one_odd_value_anywhere_is_a_reply_or_an_ask_error(dialect: Any, odd: Any) -> None:
    said = ("Look.", [("c1", "view", {"x": 1})], "calls")
    events: list[Any] = [e for e in dialect.events(*said) if isinstance(e, dict)]
    body: Any = dialect.body(*said)
    for holder, key in [*places(events), *places(body)]:
        kept, holder[key] = holder[key], odd
        spoken = SPOKEN[dialect.name]("m", UNKNOWN)
        assembly = spoken.assembly()
        with suppress(AskError):
            spoken.reply(body, REQUEST)
        with suppress(AskError):
            for event in events:
                assembly.add(event)
            spoken.reply(assembly.whole(), REQUEST)
        holder[key] = kept


@pytest.mark.parametrize("wire", WIRES)
@given(body=ANY)
def test_any_body_is_a_reply_or_an_ask_error(wire: Any, body: Any) -> None:
    with suppress(AskError):
        wire("m", UNKNOWN).reply(body, REQUEST)


LINES = st.binary(min_size=1).filter(lambda b: b"\n" not in b and b"\r" not in b)


@settings(max_examples=500)
@given(
    events=st.lists(LINES),
    cuts=st.lists(st.integers(0, 60)),
    ends=st.sampled_from([b"\n", b"\r\n", b"\r"]),
)
def test_events_are_the_same_however_they_are_cut(
    events: list[bytes], cuts: list[int], ends: bytes
) -> None:
    sent = b"".join(b"data: " + event + ends + b": comment" + ends + ends for event in events)
    places = [0, *sorted(min(cut, len(sent)) for cut in cuts), len(sent)]
    reader = Events()
    found = [event for start, end in pairwise(places) for event in reader.feed(sent[start:end])]
    assert found + reader.end() == [event.strip() for event in events if event.strip()]


@given(st.lists(LINES))
def test_events_that_come_one_by_one(events: list[bytes]) -> None:
    reader = Events()
    found = [event for given in events for event in reader.feed(b"data: " + given + b"\n\n")]
    assert found == [event.strip() for event in events if event.strip()]


def test_an_event_whose_end_comes_later() -> None:
    reader = Events()
    parts = [b"data: a\n", b"data: b\n\n", b"data: c\n\ndata: d\n\n", b"dat", b"a: e\n\n"]
    parts += [b"data: f", b"data: g\n\n"]
    found = [reader.feed(part) for part in parts]
    assert found == [[], [b"a\nb"], [b"c", b"d"], [], [b"e"], [], [b"fdata: g"]]
