"""What words demand in more than one piece, of more than one place, or of nothing at all."""

from typing import Any

import pytest
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import contract_of, question_of


def settled(words: str) -> list[dict[str, Any]]:
    """The groups of the contract for words about a thing that is pointed at; nothing is asked."""
    reading = read_instruction(words)
    assert reading.robots is not None
    asked = question_of(Task(words, None, (), ("t1",), True, None), reading, reading.robots)
    assert asked is None
    groups: list[dict[str, Any]] = contract_of(reading, reading.robots, ["t1"], [])["groups"]
    return groups


@pytest.mark.parametrize(
    ("words", "sides"),
    [
        ("4 robots: one north, one east, one south and one west of the pond", "tblr"),
        ("A robot above, a robot below, a robot left and a robot right of the box", "tblr"),
        ("Put a robot on the left and a robot on the right of the box", "lr"),
        ("Two bots on the left, two bots at the top of the crate", "lltt"),
    ],
)
def test_robots_on_several_sides(words: str, sides: str) -> None:
    groups = settled(words)
    placed = [g["side"][0] for g in groups for _ in range(g["robots"])]
    assert sorted(placed) == sorted(sides)
    assert {g["relation"] for g in groups} == {"along"}


@pytest.mark.parametrize(
    ("words", "counts"),
    [
        ("Two rings of six robots each around the drum", [6, 6]),
        ("Two circles around the drum: four robots in the inner one and nine in the outer one",
         [4, 9]),
        ("Two concentric circles of 5 round the drum", [5, 5]),
    ],
)  # fmt: skip
def test_rings_have_the_numbers_that_are_said(words: str, counts: list[int]) -> None:
    groups = settled(words)
    assert [g["robots"] for g in groups] == counts
    assert groups[0].get("fit") != groups[1].get("fit")


@pytest.mark.parametrize(
    ("words", "clearance"),
    [
        ("12 robots around the shed, no closer than 10 px and no farther than 60 px", [10, 60]),
        ("12 robots around the shed, at most 60 px away, at least 10 px away", [10, 60]),
        ("Seven robots below the pencil, 30 to 50 px beneath it", [30, 50]),
        ("8 robots in a row 40 px to the left of the truck", [40, 41]),
        ("ten robots, the big coin, 20 px off", [20, 21]),
        ("6 robots around the car, 30 px between the robots and the car", [30, 31]),
        ("6 robots around it, keep 30 px between them and it", [30, 31]),
    ],
)
def test_a_distance_in_parts_or_with_a_side(words: str, clearance: list[float]) -> None:
    assert settled(words)[0]["clearance"] == clearance


def test_bounds_that_contradict_each_other_are_asked_about() -> None:
    reading = read_instruction("8 robots around it, at least 60 px away, at most 10 px away")
    assert reading.unread


@pytest.mark.parametrize(
    "tail",
    [
        "so they don't bump into each other",
        "without touching one another",
        "not crowding",
        "the rest stay where they are",
        "none of them standing on it",
    ],
)
def test_what_every_plan_keeps_is_understood(tail: str) -> None:
    assert len(settled(f"Nine robots around the bollard, {tail}")) == 1


@pytest.mark.parametrize(
    "tail",
    [
        "Leave the others alone.",
        "Ignore the rest.",
        "Leave all the grey ones alone.",
        "The two grey stones don't matter.",
    ],
)
def test_things_that_are_left_alone_are_repeated(tail: str) -> None:
    reading = read_instruction(f"Seven robots in a ring round the white stone. {tail}")
    assert (reading.things, reading.unread) == (["the white stone"], [])
    assert tail.rstrip(".").split()[-1] in " ".join(reading.background)


@pytest.mark.parametrize(
    "thing", ["drums", "two sheds", "yellow drums in the middle, not the red ones"]
)
def test_one_of_several_is_which_thing(thing: str) -> None:
    assert read_instruction(f"Seven robots round the upper of the {thing}").unread == []


def test_the_top_of_one_thing_is_a_part_of_it() -> None:
    assert read_instruction("Seven robots round the top of the car").unread


def test_work_on_a_thing_is_no_formation() -> None:
    reading = read_instruction("Six robots should lift the big box and carry it to the others")
    assert reading.unread or reading.stops


def test_a_number_of_other_things_counts_no_robots() -> None:
    words = "One robot at each tip of the red triangle; the two smaller ones are of no interest."
    reading = read_instruction(words)
    assert (reading.relation, reading.robots, reading.one_a_corner) == ("corners", None, True)
