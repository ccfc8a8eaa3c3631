"""Instructions that leave the number of robots to the tools: as many as needed, or as fit."""

import math

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.conversation import Session
from formup.agent.offline.accounting import read_instruction
from formup.agent.report import Report
from formup.tools.context import Settings
from formup.tools.errors import InputError
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

SHOWN = (TargetPrompt(id="t1", box=(198, 98, 282, 182)),)


@pytest.fixture(scope="module")
def picture() -> Picture:
    pixels = np.full((300, 480, 3), 60, np.uint8)
    pixels[100:180, 200:280] = (200, 40, 40)
    return picture_from_array(pixels)


def said(picture: Picture, *lines: str) -> Report:
    session = Session(Agent(), picture, pointed=SHOWN)
    return [session.say(line).report for line in lines][-1]


@pytest.mark.parametrize(
    ("words", "relation", "count"),
    [
        ("cage it with as many robots as needed", "cage", "needed"),
        ("surround the crate with enough robots to close it", "around", "needed"),
        ("fence it off, use however many you need", "cage", "needed"),
        ("box it in, however many it takes", "cage", "needed"),
        ("fill the pond with as many bots as will fit, 20 px apart", "inside", "fit"),
        ("cover it with as many as possible", "inside", "fit"),
    ],
)
def test_the_number_is_left_open(words: str, relation: str, count: str) -> None:
    reading = read_instruction(words)
    assert (reading.relation, reading.count, reading.robots) == (relation, count, None)
    assert not reading.unread


@pytest.mark.parametrize(
    "words", ["put as many as needed at its corners", "5 robots around it, as many as needed"]
)
def test_what_leaves_no_number_open_is_asked_about(words: str) -> None:
    assert read_instruction(words).unread


@pytest.mark.parametrize("answer", ["as many as needed", "whatever it takes", "you decide"])
def test_as_many_as_needed_close_the_ring(picture: Picture, answer: str) -> None:
    report = said(picture, "cage the crate", answer)
    assert report.status == "planned"
    assert report.contract is not None
    group = report.contract.groups[0]
    assert group.relation == "cage"
    fewer = said(picture, f"cage the crate with {group.robots - 1} robots")
    assert "opening" in fewer.message
    assert "opening" not in report.message


def test_as_many_as_needed_hold_what_must_not_get_out(picture: Picture) -> None:
    words = "cage it with as many robots as needed so that it cannot get out"
    report = said(picture, words)
    assert report.status == "planned"
    assert report.contract is not None
    assert report.contract.groups[0].closure == "escape-proof"


def test_as_many_as_fit_are_asked_how_far_apart_and_keep_it(picture: Picture) -> None:
    session = Session(Agent(), picture, pointed=SHOWN)
    asked = session.say("fill it with as many robots as fit").report
    assert asked.message.startswith("How far apart are the robots to be?")
    with pytest.raises(InputError, match="A question is open"):
        session.say("go")
    places = session.say("20 px apart").report.positions
    assert places is not None
    apart = [math.dist(a, b) for k, a in enumerate(places) for b in places[:k]]
    assert min(apart) >= 20 - 0.01
    more = said(picture, f"fill it with {len(places) * 3 // 2} robots, at least 20 px apart")
    assert more.status == "impossible"


def test_a_number_in_answer_counts_instead(picture: Picture) -> None:
    report = said(picture, "fill it with as many robots as fit", "7")
    assert len(report.positions or ()) == 7


def test_a_number_given_apart_from_the_words_counts(picture: Picture) -> None:
    nine = Settings(robots=9, may_deploy=False)
    run = Agent().run(picture, "cage it, as many as needed", settings=nine, pointed=SHOWN)
    assert len(run.report.positions or ()) == 9
