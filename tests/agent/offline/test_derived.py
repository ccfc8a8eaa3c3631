"""The gap between two things and a part of one, by words, on a photograph."""

from functools import cache
from pathlib import Path

import pytest
from formup.agent.agent import Agent, Run
from formup.agent.outcomes import Paused
from formup.tools.context import Settings
from formup.tools.perception.image import Picture, load_picture

SWEETS = Path(__file__).parents[3] / "evals/photos/images/smarties.png"


@cache
def sweets() -> Picture:
    return load_picture(SWEETS)


def run(words: str) -> Run:
    return Agent().run(sweets(), words, settings=Settings(may_deploy=False))


@pytest.mark.parametrize(
    ("words", "kind", "robots"),
    [
        ("Fill the gap between the dark one and the leftmost one with 5 robots", "gap", 5),
        ("Spread 5 robots in the space between the leftmost one and the rightmost one", "gap", 5),
        ("Spread 3 robots inside the upper half of the leftmost one", "part", 3),
    ],
)
def test_robots_stand_in_what_the_words_make(words: str, kind: str, robots: int) -> None:
    done = run(words)
    (target,) = done.outcome.world.targets
    plan = done.outcome.world.latest.plan
    assert (target.prompt, plan.verdict.certified) == (kind, True)
    assert [g.relation for g in plan.formation.contract.groups] == ["inside"]
    assert len(plan.formation.positions) == robots


def test_what_cannot_be_found_is_asked_about() -> None:
    done = run("Fill the gap between the leftmost one and the fork with 5 robots")
    assert isinstance(done.outcome, Paused)
    assert "fork" in done.outcome.call.arguments["question"]
    assert not done.outcome.world.plans


@pytest.mark.parametrize(
    "words",
    [
        "Surround the left half of the leftmost one with 6 robots",
        "Put 6 robots between the leftmost one and the rightmost one",
        "Fill the gap between the leftmost one and the rightmost one",
    ],
)
def test_other_words_are_read_as_before(words: str) -> None:
    assert "derive_target" not in str(run(words).outcome.messages)
