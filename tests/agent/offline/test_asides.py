"""What only tells something beside a command, and counts that are taken back."""

import pytest
from formup.agent.offline.amending import amended
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
    ],
)
def test_what_only_tells_something_is_kept_as_background(words: str, told: tuple[str, ...]) -> None:
    followup = read_followup(words, STANDING)
    assert followup.kind == "edits"
    assert followup.background == told


def test_an_order_beside_a_command_is_no_background() -> None:
    assert read_followup("paint it red, a bit further out", STANDING).kind == "ask"


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("9 robots around it, no wait, 10, ten robots", "ten robots around it"),
        ("8 robots around it, make that 9", "9 robots around it"),
        ("8 robots around it, no closer than 9 px", "8 robots around it, no closer than 9 px"),
    ],
)
def test_the_number_that_is_said_last_counts(words: str, meant: str) -> None:
    assert amended(words) == meant
