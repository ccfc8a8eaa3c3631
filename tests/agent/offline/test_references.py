"""Words to a query: what is read of the thing meant, and what is refused."""

from typing import Any

import pytest
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.descriptions import Reference
from formup.agent.offline.drafting import question_of
from formup.agent.offline.references import described
from hypothesis import given, settings
from hypothesis import strategies as st

HEART = {"shapes": ["heart"]}
RED_HEART = HEART | {"colours": ["red"]}
RING, STAR = {"shapes": ["ring"]}, {"shapes": ["star"]}


FAULT = pytest.mark.xfail(strict=True, reason="a known fault of the reading")


def things(words: str) -> tuple[Reference, ...]:
    """What the phrases for things in an instruction refer to."""
    return described(read_instruction(words).things)


def pick(by: str, place: int = 1) -> dict[str, Any]:
    return {"picks": [{"by": by} if place == 1 else {"by": by, "place": place}]}


def near(kind: str, *things: dict[str, Any]) -> dict[str, Any]:
    return {"relations": [{"kind": kind, "things": list(things)}]}


@pytest.mark.parametrize(
    ("words", "query"),
    [
        ("surround the red heart", RED_HEART),
        ("SURROUND THE RED HEART!!!", RED_HEART),
        ("surround the heart that's red", RED_HEART),
        ("surround the heart which is red", RED_HEART),
        ("surround the heart coloured red", RED_HEART),
        ("surround the heart colored red", RED_HEART),
        ("surround the red-coloured heart", RED_HEART),
        ("surround 'the red heart'", RED_HEART),
        ('surround "the red heart" with 5 robots', RED_HEART),
        ("surround the red heart (with 9 robots)", RED_HEART),
        ("surround the red heart with the robots", RED_HEART),
        ("surround just the red heart", RED_HEART),
        ("the red heart: surround it", RED_HEART),
        ("the red heart needs a ring of 7 robots around it", RED_HEART),
        ("would you mind surrounding the red heart?", RED_HEART),
        ("around the red heart put 9 robots", RED_HEART),
        ("line up 4 robots on the red heart's left side", RED_HEART),
        ("put a robot at each of the red heart's corners", RED_HEART),
        ("surround the red heart at a distance of 20 pixels", RED_HEART),
        ("surround the scarlet heart", RED_HEART),
        ("surround the largest", pick("largest")),
        ("surround the thing which is the largest", pick("largest")),
        ("surround whichever object is biggest", pick("largest")),
        ("surround the thing bigger than all the others", pick("largest")),
        ("surround the thing larger than any of its neighbours", pick("largest")),
        ("surround the second-biggest thing", pick("largest", 2)),
        ("surround the second thing from the left", pick("leftmost", 2)),
        ("surround the thing third from the right", pick("rightmost", 3)),
        ("surround the thing that's furthest down", pick("bottommost")),
        ("surround the easternmost thing", pick("rightmost")),
        ("surround the thing in the top left corner of the picture", pick("upper_left")),
        ("surround the thing nearest the centre of the picture", pick("middle")),
        ("surround the odd one out", pick("odd")),
        ("surround the one that differs from the rest in colour", pick("odd_colour")),
        ("surround the thing not lined up with the others", pick("askew")),
        ("surround the thing all on its own", pick("alone")),
        ("surround the upper of the two hearts", {"count": 2} | HEART | pick("topmost")),
        ("surround the heart left of the ring", HEART | near("left_of", RING)),
        ("surround the heart just left of the ring", HEART | near("left_of", RING)),
        ("surround the heart directly above the ring", HEART | near("above", RING)),
        pytest.param(
            "fence the heart nearest to the ring in with eleven robots",
            HEART | near("nearest", RING),
            marks=FAULT,
        ),
        (
            "surround the heart that lies between the ring and the star",
            HEART | near("between", RING, STAR),
        ),
        ("surround the largest coin", {"traits": ["round"]} | pick("largest")),
    ],
)
def test_words_become_a_query(words: str, query: dict[str, Any]) -> None:
    (thing,) = things(words)
    assert not thing.refused
    assert thing.whole_query == query


@pytest.mark.parametrize(
    "words",
    [
        "surround the coin box",
        "surround the roof of the red house",
        "surround the largest coin's shadow",
        "surround the red heart's neighbour",
        "surround the red L's heart",
        "surround the head on the largest coin",
        "surround the coin that isn't silver",
        "surround the heart at the bottom that isn't red",
        "surround the heart but not the red one",
        "surround every coin except the biggest",
        "surround the other heart",
        "surround the almost largest coin",
        "surround the least large coin",
        "surround the last red heart from the top",
        "surround the non-red heart at the top",
        "surround the formerly biggest coin",
        "surround the medium coin",
        "surround the third coin",
        "surround the coin larger than the quarter",
        "surround the red and blue heart",
        "surround the red or blue heart",
        "surround the red heart or star",
        pytest.param("surround the red heart and ring", marks=FAULT),
        "surround the red heart, blue ring",
        "surround the red heart's left neighbour",
        "surround the shiniest of the coins",
        "surround the dog",
        "surround the largest dog",
        "surround the dog nearest to the ring",
        "surround the coin with the eagle on it",
        "surround the top left corner",
        "surround the heart below the ring above the star",
    ],
)
def test_words_that_change_who_is_meant_are_refused(words: str) -> None:
    reading = read_instruction(words)
    found = described(reading.things)
    unclear = [t for t in found if t.refused or t.plural or t.unknown or not t.whole_query]
    assert unclear or len(found) != 1 or reading.unread


@pytest.mark.parametrize(
    "words",
    [
        "look at the red heart. surround the other one",
        "look at the red heart. surround the one to its left",
        "see the red heart? surround the thing below it",
        "surround the red heart (the new one)",
        "surround the red heart or the star",
    ],
)
def test_a_second_thing_is_not_taken_for_the_first(words: str) -> None:
    assert len(things(words)) == 2 or read_instruction(words).unread


def test_long_chains_are_read_in_time_that_grows_with_them() -> None:
    assert described(["the heart left of " * 200 + "the ring"])[0].refused


WORDS = """
the a this of two six second last other not no but and or than that which is isn't its it 's
red purple largest small round heart coin boat coins ring corner side left right top of below
between nearest in on at by with from surround cage fill line put along around robots 7 20 px ,
. ? ! ;
"""
SALAD = st.lists(st.sampled_from(WORDS.split()), max_size=40).map(" ".join)


@settings(deadline=None, max_examples=150)
@given(st.one_of(SALAD, st.text(max_size=80)))
def test_any_words_are_read_without_a_crash(words: str) -> None:
    reading = read_instruction(words)
    task = Task(words, None, (), (), True, None)
    if reading.unread or reading.stops:
        assert question_of(task, reading, reading.robots)
    assert all(thing.wording for thing in described(reading.things))


@pytest.mark.parametrize("phrase", ["a red coin", "red coin", "the red coin"])
def test_a_phrase_names_its_thing_with_any_article(phrase: str) -> None:
    (thing,) = described([phrase])
    assert (thing.query, thing.noun) == ({"colours": ["red"]}, "circle")
