"""Robots that are meant by where they stand, several of them at once, or by what they are near."""

import json
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.conversation import Session
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

THINGS = (("t1", (310, 245)), ("t2", (360, 60)))


@pytest.fixture(scope="module")
def ring() -> Session:
    pixels = np.full((540, 800, 3), 120, np.uint8)
    pixels[220:270, 260:360] = (40, 60, 200)
    pixels[30:90, 330:390] = (40, 140, 50)
    pointed = tuple(TargetPrompt(id=name, points=(at,)) for name, at in THINGS)
    session = Session(Agent(), picture_from_array(pixels), pointed=pointed)
    report = session.say("8 robots around t1, 30 px away").report
    assert report.positions is not None
    return session


def edits_of(session: Session) -> list[dict[str, Any]]:
    world = session.context.world
    return json.loads(world.plans[world.current or ""].edit or "[]")


def on_the_right(session: Session) -> list[int]:
    places = session.say("how far is robot 1?").report.positions or ()
    return [k for k, (x, y) in enumerate(places, 1) if x - 310 > abs(y - 245)]


@pytest.mark.parametrize(
    "words", ["the ones on the right come closer", "the right robots 12 px closer"]
)
def test_the_robots_on_a_side_are_those_that_stand_there(ring: Session, words: str) -> None:
    session, meant = ring.fork(), on_the_right(ring.fork())
    assert session.say(words).report.status == "planned"
    assert [edit["robot"] for edit in edits_of(session)] == meant
    assert all(edit["by"][0] < 0 for edit in edits_of(session))


@pytest.mark.parametrize("words", ["get rid of everyone on the right", "those on the right leave"])
def test_those_on_a_side_can_leave(ring: Session, words: str) -> None:
    session, meant = ring.fork(), on_the_right(ring.fork())
    assert session.say(words).report.status == "planned"
    assert edits_of(session) == [{"kind": "remove", "robots": meant}]


@pytest.mark.parametrize("words", ["everyone on the left", "put everybody on the left"])
def test_a_side_where_all_are_to_stand_names_no_robots(ring: Session, words: str) -> None:
    session = ring.fork()
    session.say(words)
    assert edits_of(session) == [{"kind": "sides", "only": ["left"]}]


def test_robots_that_fit_alike_are_asked_about(ring: Session) -> None:
    session = ring.fork()
    for words in ("swap the two at the bottom", "the two nearest the top can go"):
        assert session.say(words).report.message.startswith("Which robot is meant?")
        session.say("never mind")


def test_a_robot_is_known_by_what_it_is_near(ring: Session) -> None:
    session = ring.fork()
    assert session.say("send the robot nearest t2 home").report.message.startswith("Which robot")
    session.say("never mind")
    session.say("robot 7 goes home")
    nearest = session.say("who is nearest to t2?").report.message
    session.say("send the robot nearest t2 home")
    removed = [edit["robots"] for edit in edits_of(session)]
    assert len(removed) == 1
    assert f"Robot {removed[0][0]}:" in nearest
