"""Words that put one part of the line before right, and what is pointed at beside them."""

import json
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.conversation import Session
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

THINGS = (("t1", "car", (310, 245)), ("t2", "tree", (600, 140)))


@pytest.fixture(scope="module")
def ring() -> Session:
    pixels = np.full((540, 800, 3), 120, np.uint8)
    pixels[220:270, 260:360] = (40, 60, 200)
    pixels[100:180, 560:640] = (40, 140, 50)
    pointed = tuple(TargetPrompt(id=i, label=label, points=(at,)) for i, label, at in THINGS)
    session = Session(Agent(), picture_from_array(pixels), pointed=pointed)
    assert session.say("8 robots around t1, 30 px away").report.status == "planned"
    return session


def edits_of(session: Session) -> list[dict[str, Any]]:
    world = session.context.world
    return json.loads(world.plans[world.current or ""].edit or "[]")


@pytest.mark.parametrize(
    ("before", "status", "words", "edits"),
    [
        ("2 metres away please", "answered", "20 px then", [{"kind": "distance", "px": 20.0}]),
        (
            "swap robot 3 with itself",
            "question",
            "with robot 7 then",
            [{"kind": "swap", "a": 3, "b": 7}],
        ),
        ("10 px away and 40 px away", "question", "the first", [{"kind": "distance", "px": 10.0}]),
        ("10 px away and 40 px away", "question", "the second", [{"kind": "distance", "px": 40.0}]),
        ("20 px away", "planned", "i meant 40", [{"kind": "distance", "px": 40.0}]),
        (
            "move robot 3 up a bit",
            "planned",
            "robot 4 i mean",
            [{"kind": "place", "robot": 4, "by": [0.0, -27.0]}],
        ),
        (
            "around the spaceship",
            "question",
            "t2 i mean",
            [{"kind": "target", "to": "t2", "stay": False}],
        ),
    ],
)
def test_a_part_of_the_line_before_is_put_right(
    ring: Session, before: str, status: str, words: str, edits: list[dict[str, Any]]
) -> None:
    session = ring.fork()
    assert session.say(before).report.status == status
    assert session.say(words).report.status == "planned"
    assert edits_of(session) == edits


@pytest.mark.parametrize("before", ["thanks", "a bit closer"])
def test_a_part_that_nothing_before_is_like_is_asked_about(ring: Session, before: str) -> None:
    session = ring.fork()
    session.say(before)
    assert session.say("with robot 7 then").report.status == "question"


def test_what_was_changed_is_taken_back_for_the_correction(ring: Session) -> None:
    session = ring.fork()
    session.say("move robot 3 up a bit")
    at = session.say("robot 4 i mean").report.positions
    first = ring.fork().say("how far is robot 3?").report.positions
    assert at is not None
    assert first is not None
    assert [k for k in range(8) if at[k] != pytest.approx(first[k])] == [3]


@pytest.mark.parametrize("words", ["robot 5 there", "robot 5 goes here", "put robot 5 there"])
def test_a_robot_goes_to_the_point_that_is_shown(ring: Session, words: str) -> None:
    session = ring.fork()
    report = session.say(words, pointed=(TargetPrompt(points=((120, 430),)),)).report
    assert report.status == "planned", report.message
    assert report.positions is not None
    assert report.positions[4] == pytest.approx((120, 430))
