"""Tokens counted alike for everybody."""

from io import BytesIO

import pytest
from formup.agent.messages import Call, Reply, Result, User
from formup.agent.wrappers.two_stages import offered
from formup.evals.experiments.tokens import Spent, picture_tokens, spent, text_tokens
from formup.prompts import load_prompt
from formup.tools.builtin import TOOLS
from PIL import Image


def picture(width: int, height: int) -> bytes:
    file = BytesIO()
    Image.new("RGB", (width, height)).save(file, "PNG")
    return file.getvalue()


@pytest.mark.parametrize(
    ("size", "tokens"),
    [((750, 1000), 1000), ((1000, 750), 1000), ((1568, 750), 1568), ((3136, 1500), 1568)],
)
def test_pictures(size: tuple[int, int], tokens: int) -> None:
    assert picture_tokens(*size) == tokens


def test_every_request_is_paid_whole() -> None:
    first = User(text="x" * 40, images=(picture(75, 100),))
    reply = Reply(text="y" * 8, calls=(Call(id="1", name="look", arguments={}),))
    result = Result(call_id="1", name="look", text="z" * 80)
    last = Reply(text="w" * 12)
    written = text_tokens('[{"name":"look","arguments":{}}]')
    begins = 10 + 10 + 5
    assert spent((first,), "s" * 20) == Spent(0, 0, 0, 0)
    assert spent((first, reply), "s" * 20) == Spent(1, begins, 2 + written, begins)
    whole = spent((first, reply, result, last), "s" * 20)
    paid = begins + begins + 2 + written + 20
    assert whole == Spent(2, paid, 2 + written + 3, paid)  # too short a prompt to be kept


def test_tools_are_part_of_every_request() -> None:
    once = (User(text=""), Reply(text="a"))
    twice = (*once, User(text=""), Reply(text="b"))
    tools = spent(once, "", TOOLS).input
    assert tools > 2500
    assert spent(twice, "", TOOLS).input == 2 * tools + spent(twice).input
    assert spent(twice, "", TOOLS).output == 2


@pytest.mark.parametrize(
    ("name", "most"),
    [("former", 2000), ("context", 2000), ("planner", 2000), ("converse", 2600), ("revise", 2600)],
)
def test_what_every_request_begins_with_is_short(name: str, most: int) -> None:
    prompt = load_prompt(name)
    said = spent((User(text=""), Reply(text="a")), prompt.render(), offered(TOOLS, prompt))
    assert said.input <= most


def test_no_model_is_offered_what_only_other_tools_could_fill() -> None:
    for name, filled in (("former", False), ("repair", True)):
        tools = offered(TOOLS, load_prompt(name))
        (propose,) = (tool for tool in tools if tool.name == "propose_formation")
        assert ("samples" in propose.offered["properties"]) is filled
        assert "samples" in propose.schema["properties"]


def test_a_prompt_in_the_cache_is_paid_a_tenth_of() -> None:
    once = (User(text="x" * 40), Reply(text="a"))
    whole, held = spent(once, "s" * 40_000), spent(once, "s" * 4 * 1024)
    assert (whole.input, whole.cached) == (10_010, 1_010)
    assert held.cached == 10 + 102
    assert spent(once, "s" * 4 * 1023).cached == 1033
