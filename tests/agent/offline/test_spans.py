"""Where phrases for things end, so that no demand is lost in one."""

import pytest
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import question_of
from formup.agent.offline.reading import Reading


def read(words: str) -> tuple[Reading, str | None]:
    """What is understood of an instruction for a thing that is pointed at, and what is asked."""
    reading = read_instruction(words)
    return reading, question_of(Task(words, None, (), ("t1",), True, None), reading, reading.robots)


@pytest.mark.parametrize(
    ("words", "relation", "fields"),
    [
        (
            "Ring the post with 9 robots, each of them 30 px or more from it",
            "around",
            [30, 100_000],
        ),
        ("Ring the post with 9 robots, but not nearer than thirty pixels", "around", [30, 100_000]),
        (
            "Put 9 robots on the roof, keep them a good 10 px in from the eaves",
            "inside",
            [10, 100_000],
        ),
    ],
)
def test_bounds_of_a_distance_may_stand_anywhere(
    words: str, relation: str, fields: list[float]
) -> None:
    reading, question = read(words)
    assert question is None
    assert (reading.relation, reading.group["clearance"]) == (relation, fields)


@pytest.mark.parametrize(
    ("words", "fields"),
    [
        ("ten robots circle the white plate, all of them looking at its centre", "towards"),
        ("ten robots circle the white plate, noses pointing outwards", "away"),
    ],
)
def test_a_heading_is_no_part_of_the_phrase_before_it(words: str, fields: str) -> None:
    reading, question = read(words)
    assert question is None
    assert reading.group["heading"] == fields
    assert reading.things == ["the white plate"]


def test_what_is_to_be_prevented_demands_nothing_but_a_closed_ring() -> None:
    reading, question = read(
        "Form a closed cage of 12 robots around it so that nobody gets near it"
    )
    assert question is None
    assert (reading.relation, reading.group) == ("cage", {})
    assert reading.background == ["so that nobody gets near it"]
