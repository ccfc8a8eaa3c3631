"""Words to a query: what is read of the thing meant, what is refused, what is left over."""

from typing import Any

import pytest
from formup.agent.offline.arrangements import understand
from formup.agent.offline.references import references
from hypothesis import given, settings
from hypothesis import strategies as st

HEART = {"shapes": ["heart"]}
RED_HEART = HEART | {"colours": ["red"]}
RING, STAR = {"shapes": ["ring"]}, {"shapes": ["star"]}


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
        (
            "fence the heart nearest to the ring in with eleven robots",
            HEART | near("nearest", RING),
        ),
        (
            "surround the heart that lies between the ring and the star",
            HEART | near("between", RING, STAR),
        ),
        ("surround the largest coin", {"traits": ["round"]} | pick("largest")),
    ],
)
def test_words_become_a_query(words: str, query: dict[str, Any]) -> None:
    (thing,) = references(words).things
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
        "surround the red heart and ring",
        "surround the red heart, blue ring",
        "surround the red heart's left neighbour",
        "surround the shiniest of the coins",
        "surround the dog",
        "surround the largest dog",
        "surround the dog nearest to the ring",
        "surround the coin with the eagle on it",
        "surround the top left corner",
        "surround the heart below the ring above the star",
        "surround the heart I pointed at",
    ],
)
def test_words_that_change_who_is_meant_are_refused(words: str) -> None:
    things = references(words).things
    unclear = [t for t in things if t.refused or t.plural or t.unknown or not t.whole_query]
    assert unclear or len(things) > 1


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
    assert len(references(words).things) == 2


@pytest.mark.parametrize(
    ("words", "rest"),
    [
        ("put 5 robots on the left of the red heart", "put 5 robots on the left of it"),
        ("surround the red heart's corners", "surround its corners"),
        ("the red heart: circle it", "it : circle it"),
        ("fill the heart inside the ring", "fill it"),
    ],
)
def test_the_rest_is_for_the_arrangement(words: str, rest: str) -> None:
    assert references(words).rest == rest


@pytest.mark.parametrize(
    "words",
    [
        "you shouldn't surround it",
        "stop surrounding it",
        "avoid surrounding it",
        "form a square around it",
        "make a heart around it",
        "surround it with half of the robots",
        "half-surround it",
        "surround it on three sides",
        "put 3 robots on every side of it",
        "surround it with 2 rings of 6 robots",
        "surround it in two rows",
        "surround it with 6 robots, 3 left and 3 right",
        "line up along its left side and along its top side",
        "line up along the lower left side of it",
        "surround it, at most 20 px away",
        "cage it leaving one exit",
        "surround it but leave a gap at the top",
        "remove the robots around it",
        "yesterday they surrounded it",
        "nobody should surround it",
        "count the robots around it",
        "fill the bottom of it",
        "if there is a star, surround it",
        "surround it unless it is red",
    ],
)
def test_what_cannot_be_carried_out_is_said(words: str) -> None:
    assert understand(words).beyond


@pytest.mark.parametrize(
    "words",
    [
        "what surrounds it?",
        "should I surround it?",
        "why do robots surround it?",
        "are the robots around it?",
    ],
)
def test_a_question_is_no_instruction(words: str) -> None:
    assert understand(words).relations == ()


@pytest.mark.parametrize(
    "words",
    ["could you surround it?", "which is red? Surround it.", "surround it, will you?"],
)
def test_a_polite_question_is_one(words: str) -> None:
    assert understand(words).relations == ("around",)


@pytest.mark.parametrize(
    ("words", "robots", "odd"),
    [
        ("surround it with 6robots", 6, None),
        ("12robots around it", 12, None),
        ("with 6 to 8 robots", None, "6 to 8 robots"),
        ("with six or seven robots", None, "six or seven robots"),
        ("with 6-8 robots", None, "6-8 robots"),
        ("with 1e3 robots", None, None),
        ("with 3 + 4 robots", None, "3 + 4 robots"),
        ("with five, no, six robots", None, "five, no, six robots"),
        ("with more than 6 robots", None, "more than 6"),
        ("with 6% of the robots", None, "6%"),
    ],
)
def test_glued_and_loose_numbers(words: str, robots: int | None, odd: str | None) -> None:
    reading = understand(words)
    assert (reading.robots, reading.odd_count) == (robots, odd)


def test_long_chains_are_read_in_time_that_grows_with_them() -> None:
    words = "surround " + "the heart left of " * 200 + "the ring"
    assert references(words).things[0].refused


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
    reading = references(words)
    assert isinstance(understand(reading.rest).relations, tuple)
    assert all(thing.wording for thing in reading.things)


@pytest.mark.parametrize("length", ["1.4 m", "0.64m", "1,500 mm", "12.5 px"])
def test_numbers_with_a_point_or_a_comma_stay_whole(length: str) -> None:
    assert length in references(f"Surround the red box, {length} from it.").rest
    assert understand(references("2.5 robots around the red box").rest).robots is None
