"""What only tells something beside a command, and counts that are taken back."""

import pytest
from formup.agent.offline.amending import with_last_count
from formup.agent.offline.followups import read_followup
from formup.agent.offline.standing import Standing

GROUP = {"relation": "around", "targets": ["t1"], "robots": 6}
STANDING = Standing("p", {"groups": [GROUP]}, tuple("123456"), things=(("t1", "coin"),))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("my boss is here. turn it 20 degrees", ("my boss is here",)),
        ("it is rather urgent, a bit further out", ("it is rather urgent",)),
        ("turn it 20 degrees", ()),
        (
            "the gardener has to get past, so leave the left side free",
            ("the gardener has to get past",),
        ),
        ("leave the left side free so the hose can lie there", ("so the hose can lie there",)),
        ("open a gap on the left, wide enough for a barrow", ("wide enough for a barrow",)),
        ("this is getting too crowded could you move them out", ("this is getting too crowded",)),
        ("that's nearer than we planned, move them 20 px out", ("that's nearer than we planned",)),
        ("six is overkill, make it four", ("six is overkill",)),
        ("they look sad, two more", ("they look sad",)),
        ("that is too tight, make it five", ("too tight",)),
        ("the cat needs room, robot 2 a bit to the left", ("the cat needs room",)),
        ("robot 3 looks crooked, move it a bit up", ("robot 3 looks crooked",)),
    ],
)
def test_what_only_tells_something_is_kept_as_background(words: str, told: tuple[str, ...]) -> None:
    followup = read_followup(words, STANDING)
    assert followup.kind == "edits"
    assert followup.background == told


@pytest.mark.parametrize(
    "words",
    [
        "paint it red, a bit further out",
        "because robot 3 is slow, a bit further out",
        "that's not too close, a bit further out",
        "nine is overkill, make it four",
        "robot 3 looks crooked, a bit further out",
        "so that 2 people can pass, leave a gap on the left",
        "the left side is blocked, make it four",
    ],
)
def test_what_may_demand_something_beside_a_command_is_no_background(words: str) -> None:
    assert read_followup(words, STANDING).kind == "ask"


def test_the_robot_that_is_told_of_is_the_one_that_moves() -> None:
    followup = read_followup("robot 3 looks crooked, move it a bit up", STANDING)
    assert [e["robot"] for e in followup.edits] == [3]


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("9 robots around it, no wait, 10, ten robots", "ten robots around it"),
        ("8 robots around it, make that 9", "9 robots around it"),
        ("8 robots around it, no closer than 9 px", "8 robots around it, no closer than 9 px"),
    ],
)
def test_the_number_that_is_said_last_counts(words: str, meant: str) -> None:
    assert with_last_count(words) == meant
