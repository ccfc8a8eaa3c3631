"""What a reply may refer to, doubts told and plans made, and what words alone come to."""

from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply, Result
from formup.agent.policy import Policy
from formup.agent.session import Run
from formup.agent.wrappers.doubles import ScriptedModel
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

CORNERS = "Put 6 robots at the corners of the box"
DEPLOY = Call(id="d", name="deploy", arguments={})
LOST = Call(id="s", name="segment", arguments={"id": "t1", "candidate": "c99"})


def reading(propose: Call, id: str) -> Call:
    """The proposal with a reason for what it says."""
    contract = {**propose.arguments["contract"], "reading": "A ring is what is meant."}
    return Call(id=id, name=propose.name, arguments={**propose.arguments, "contract": contract})


def run(picture: Picture, words: str, *replies: Reply, **more: Any) -> Run:
    return Agent(ScriptedModel([*replies, Reply(text="I am done.")]), **more).run(picture, words)


def errors(made: Run) -> list[str | None]:
    return [m.cause or m.error for m in made.outcome.messages if isinstance(m, Result)]


def test_a_reading_answers_a_doubt_of_an_earlier_reply(red_box: Picture, propose: Call) -> None:
    first = Reply(calls=(reading(propose, "p1"), reading(propose, "p2")))
    made = run(red_box, CORNERS, first, Reply(calls=(reading(propose, "p3"),)))
    assert errors(made) == ["doubt", "doubt", None]
    assert made.report.status == "planned"


def test_a_reading_answers_no_doubt_of_an_earlier_turn(red_box: Picture, propose: Call) -> None:
    first = run(red_box, CORNERS, Reply(calls=(reading(propose, "p1"),)))
    replies = [Reply(calls=(reading(propose, "p2"),)), Reply(text="No.")]
    assert errors(Agent(ScriptedModel(replies)).say(first, CORNERS)) == ["doubt", "doubt"]


def test_a_later_reply_names_the_plan_it_deploys(
    red_box: Picture, propose: Call, drives: list[Any]
) -> None:
    made = run(red_box, "Surround it", Reply(calls=(propose,)), Reply(calls=(DEPLOY,)))
    assert errors(made) == [None, "tool"]
    assert drives == []
    both = Reply(calls=(propose, DEPLOY))
    assert errors(run(red_box, "Surround it", both)) == [None, None]
    assert drives


@pytest.mark.parametrize(
    ("replies", "policy", "status"),
    [
        ((Reply(text="Hello! Which thing shall they surround?"),), (), "answered"),
        ((Reply(calls=(Call(id="l", name="look", arguments={}),)),), (), "answered"),
        ((Reply(text=" "),), (), "impossible"),
        ((Reply(calls=(LOST,)),), (), "impossible"),
        ((Reply(calls=(LOST, Call(id="l", name="look", arguments={}))),), (), "impossible"),
        ((Reply(calls=(DEPLOY,)),), (("deploy", "refuse"),), "impossible"),
    ],
)
def test_words_alone_answer_unless_something_failed(
    replies: tuple[Reply, ...], policy: Any, status: str, red_box: Picture
) -> None:
    made = run(red_box, "Hello", *replies, policy=Policy(policy))
    assert made.report.status == status
    assert made.report.exit_code == (0 if status == "answered" else 3)


def test_words_after_a_plan_that_is_not_certified_are_no_answer(
    red_box: Picture, propose: Call
) -> None:
    crowded = {**propose.arguments, "positions": [[10, 10]] * 6}
    bad = Call(id="p", name=propose.name, arguments=crowded)
    made = run(red_box, "Surround it", Reply(calls=(bad,)))
    assert made.report.status == "impossible"
    later = Agent(ScriptedModel([Reply(text="You are welcome.")])).say(made, "Thank you")
    assert later.report.status == "answered"


def test_the_rules_answer_a_doubt_about_a_form() -> None:
    pixels = np.full((600, 800, 3), 90, np.uint8)
    pixels[260:320, 360:440] = (200, 40, 40)
    words = "Encircle it with 10 robots in a star around it"
    pointed = [TargetPrompt(box=(355, 255, 445, 325))]
    made = Agent().run(picture_from_array(pixels), words, pointed=pointed)
    assert errors(made) == ["doubt", None, None]
    assert made.report.status == "deployed"
    assert made.report.contract is not None
    assert made.report.contract.reading
