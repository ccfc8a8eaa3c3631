"""First instructions about several things that are pointed at, with the real tools."""

import pytest
from formup.agent.agent import Agent
from formup.agent.offline.several import shares
from formup.agent.session import Run
from formup.tools.context import Settings
from formup.tools.perception.image import Picture
from formup.tools.perception.target_prompt import TargetPrompt

RED, BLUE = (250, 220), (560, 300)


def run(picture: Picture, words: str) -> Run:
    pointed = [TargetPrompt(points=(RED,)), TargetPrompt(points=(BLUE,))]
    return Agent().run(picture, words, pointed=pointed, settings=Settings(may_deploy=False))


def counts(picture: Picture, words: str) -> dict[str, int]:
    """Robots about each thing; none where no plan was made."""
    contract = run(picture, words).report.contract
    planned = contract.groups if contract is not None else ()
    return {g.targets[0]: g.robots for g in planned if g.relation == "around"}


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("twelve robots, half around the left coin and half around the right one", (6, 6)),
        ("put 3 robots around the red disc and 2 around the blue one", (3, 2)),
        ("3 around the red one and 4 around the other", (3, 4)),
        ("10 robots, 4 around the red one, the rest around the blue one", (4, 6)),
        ("surround the red disc with 5 robots and the blue disc with 6", (5, 6)),
        ("around the red disc 6 robots, around the blue disc 4 robots", (6, 4)),
        ("split 12: 7 t1, 5 t2", (7, 5)),
        ("two around the left, four around the right", (2, 4)),
        ("i want 4 robots to guard the red one and 3 to guard the blue one", (4, 3)),
        ("5 robots around t1 and as many around t2", (5, 5)),
        ("five robots around each of these two", (5, 5)),
    ],
)
def test_each_thing_gets_what_is_said(
    picture: Picture, words: str, wanted: tuple[int, int]
) -> None:
    assert counts(picture, words) == dict(zip(("t1", "t2"), wanted, strict=True))


@pytest.mark.parametrize(
    "words",
    [
        "10 robots, 4 around the red one and 5 around the blue one",
        "half around the red disc and half around the blue disc",
        "just put one robot on each side of the red disc",
        "8 robots around it, 4 of them blue",
    ],
)
def test_what_does_not_add_up_is_asked(picture: Picture, words: str) -> None:
    assert run(picture, words).report.status == "question"


def test_what_is_said_of_all_holds_for_each(picture: Picture) -> None:
    found = run(picture, "5 robots around t1 and 7 around t2, 20 px off, all facing in")
    assert found.report.contract is not None
    for group in found.report.contract.groups:
        assert (group.clearance, group.heading) == ((20, 21), "towards")


def test_two_sides_of_one_thing_are_no_two_things() -> None:
    assert not shares("4 on the left of the coin and 4 on the right")
    assert not shares("8 robots around the coin and 20 px off")
