"""What first instructions say of parts of the team, and how far apart its robots stand."""

from typing import Any

import pytest
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import contract_of, question_of, things_needed
from formup.agent.offline.reading import Reading
from formup.tools.formation.contract import Contract


def read(words: str, robots: int | None = None) -> tuple[Reading, str | None]:
    """The reading of an instruction about a thing that is pointed at, and what is asked."""
    reading = read_instruction(words)
    targets = ("t1", "t2")[: things_needed(reading)]
    task = Task(words, None, (), targets, True, None)
    return reading, question_of(task, reading, robots or reading.robots)


def test_so_many_on_each_side_is_asked_about_where_the_sides_are_not_known() -> None:
    for words in ("Two robots on each side of it", "7 robots, two on each side of it"):
        reading, question = read(words)
        assert reading.unread
        assert question is not None


@pytest.mark.parametrize(
    ("words", "sides"),
    [
        ("6 robots on three sides of it, nothing on the right", ["left", "top", "bottom"]),
        ("6 robots on three sides of it: left, top and right", ["left", "top", "right"]),
        ("6 robots on three sides of it", None),
        ("6 robots on three sides of it: left and top", None),
    ],
)
def test_some_of_the_sides_are_those_that_are_named(words: str, sides: list[str] | None) -> None:
    reading, question = read(words)
    assert (question is None) == (sides is not None)
    assert sides is None or (reading.relation, reading.group) == ("around", {"sides": sides})


@pytest.mark.parametrize(
    ("words", "groups"),
    [
        ("Ring it with 8 robots and one in the middle of it", [("around", 8), ("centre", 1)]),
        ("A robot at each corner of it and one at its centre", [("corners", 4), ("centre", 1)]),
        ("8 robots around it and another two above it", [("around", 8), ("along", 2)]),
        ("Flank it with 8 robots on both long sides", [("along", 4), ("along", 4)]),
        ("8 robots in two rows of four inside it", [("shape", 8)]),
        ("8 robots in two rows of four below it", [("along", 4), ("along", 4)]),
    ],
)
def test_rows_of_so_many_and_robots_besides(words: str, groups: list[tuple[str, int]]) -> None:
    reading, question = read(words, 4 if "corner" in words else None)
    assert question is None
    robots = reading.robots or 4
    contract = contract_of(reading, robots, ["t1"], [])
    assert [(g["relation"], g["robots"]) for g in contract["groups"]] == groups
    Contract.model_validate(contract)


@pytest.mark.parametrize(
    ("words", "fields"),
    [
        ("8 robots around it, minimum spacing 20 px", {"min_spacing": 20}),
        ("8 robots around it, minimum inter-robot spacing 20 px", {"min_spacing": 20}),
        ("8 robots round the basin, not less than 50 px between each other", {"min_spacing": 50}),
        ("8 robots round it, between each other not less than 50 px", {"min_spacing": 50}),
        ("8 robots round it, distance between robots 40 pixel", {"pitch": 40}),
        ("8 robots round it, separated from one another by 30 px", {"pitch": 30}),
        ("8 robots round it, the greatest distance between neighbours 60 px", {"max_gap": 60}),
        ("8 robots round it, nobody nearer than 20 px to a neighbour", {"min_spacing": 20}),
        ("8 robots round it, one robot every 30 px", {"pitch": 30}),
        ("8 robots round it, nobody nearer than 25 px to the blades", {"clearance": [25, 100_000]}),
        ("8 robots round the jet, 40 px clear of the wings", {"clearance": [40, 41]}),
        ("Set up a perimeter on the depot, 8 robots, and stand off 30 px", {"clearance": [30, 31]}),
        ("8 robots on a circle of radius 90 px centred on the plate", {"radius": 90}),
        ("8 robots round it, but don't block the exit at the top",
         {"opening": 0, "opening_towards": "top"}),
        ("8 robots round it and give it plenty of room", {"fit": "wide"}),
        ("8 robots in an arc above it, 30 px off", {"sides": ["top half"], "clearance": [30, 31]}),
    ],
)  # fmt: skip
def test_a_ring_is_described_in_many_words(words: str, fields: dict[str, Any]) -> None:
    reading, question = read(words)
    assert question is None
    assert (reading.relation, reading.robots, reading.group) == ("around", 8, fields)


def test_a_robot_every_so_many_pixels_counts_no_robots() -> None:
    reading, question = read("Ring the pond with one robot every 80 px")
    assert (reading.robots, reading.group) == (None, {"pitch": 80})
    assert question is not None


@pytest.mark.parametrize(
    ("words", "things"),
    [
        ("7 around lighthouse", ["lighthouse"]),
        ("ring of 7 robots around old statue", ["old statue"]),
        ("7 inside bunker", ["bunker"]),
        ("7 around rock, all looking away from rock", ["rock"]),
        ("Seven robots in the middle between the shed and the barn", ["the shed and the barn"]),
        ("between barn and the silo, seven robots", ["barn and the silo"]),
        ("Seven robots between these two", []),
    ],
)
def test_nouns_name_the_thing_without_an_article(words: str, things: list[str]) -> None:
    reading, question = read(words)
    assert question is None
    assert (reading.robots, reading.things) == (7, things)


def test_no_word_that_arranges_is_taken_for_a_noun() -> None:
    for words in ("7 robots along wall side", "7 robots around 3 trees", "7 robots across each"):
        assert read(words)[1] is not None, words


@pytest.mark.parametrize(
    "words",
    [
        "8 robots around the van and not 2 on the left",
        "5 robots around the shed without blocking the gate on the right",
        "6 robots on the left of the van and none on the right",
        "6 robots around it and never 2 at the top",
        "4 robots at its corners but none in the middle",
    ],
)
def test_what_is_denied_is_never_lost_in_a_name(words: str) -> None:
    reading, question = read(words)
    assert question is not None or {"sides", "opening"} & set(reading.group)
