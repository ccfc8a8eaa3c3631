"""Robots that would each have to go before the others: they may share the places, if asked."""

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.session import Run
from formup.tools.context import Settings
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

STRIP = ((30, 6), (570, 6), (570, 34), (30, 34))
WIDE = Settings(robot_radius=9.5)


@pytest.fixture(scope="module")
def row() -> Run:
    """Five robots in a row, in a picture so low that none can pass another."""
    pixels = np.full((40, 600, 3), 200, np.uint8)
    pixels[6:34, 30:570] = (200, 40, 40)
    pointed = [TargetPrompt(outline=STRIP)]
    words = "spread 5 robots inside it"
    return Agent().run(picture_from_array(pixels), words, settings=WIDE, pointed=pointed)


@pytest.fixture(scope="module")
def asked(row: Run) -> Run:
    return Agent().say(row, "turn it 180 degrees", settings=WIDE)


def test_robots_that_cannot_pass_each_other_may_share_their_places(row: Run, asked: Run) -> None:
    assert asked.report.status == "question"
    assert "stand in each other's way" in asked.report.message
    assert "Shall the robots share the places among themselves?" in asked.report.message
    agreed = Agent().resume(asked, answer="yes")
    assert (agreed.report.status, agreed.report.parent) == ("deployed", row.report.plan_id)
    ways = np.asarray(agreed.report.positions) - np.asarray(row.report.positions)
    assert np.abs(ways).max() < 3, "each has taken the place beside its own"


@pytest.mark.parametrize("answer", ["no", "2", "whatever"])
def test_anything_but_a_yes_leaves_the_plan_that_stands(row: Run, asked: Run, answer: str) -> None:
    left = Agent().resume(asked, answer=answer)
    assert (left.report.status, left.report.plan_id) == ("impossible", row.report.plan_id)
    assert "Nothing was changed" in left.report.message


def test_no_question_offers_to_share_places_that_are_to_be_exchanged(row: Run) -> None:
    swapped = Agent().say(row, "swap robots 1 and 2", settings=WIDE)
    assert swapped.report.status == "impossible"
    assert "stand in each other's way" in swapped.report.message
