"""What no contract carries out, or nobody said to do, is asked about, with the words quoted."""

import pytest
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import question_of, things_needed


def asked(words: str, scale: float | None = 0.05) -> str | None:
    """What is asked about an instruction for a thing that is pointed at; None where nothing is."""
    reading = read_instruction(words, scale)
    targets = ("t1", "t2")[: things_needed(reading)]
    return question_of(Task(words, None, (), targets, True, scale), reading, reading.robots)


ASKED = [
    # lengths that are of something else
    ("shifted 25 px to the left", "shifted 25 px"),
    ("at least 80 px from the edge of the picture", "80 px"),
    ("one and a half times its height away", "times"),
    ("twice as far as usual", "twice"),
    ("5 feet to the second power away", "power"),
    ("-12 px away", "-12 px"),
    ("at angles of 40 degrees", "40 degrees"),
    ("4 m\u00b2 away", "4 m\u00b2"),
    ("at 3 m/s", "3 m/s"),
    ("a stone's throw away", "stone's throw"),
    ("touching it", "touching"),
    # forms and sizes
    ("in a figure of eight", "figure of eight"),
    ("in a rhombus", "rhombus"),
    ("in an enormous circle", "enormous"),
    ("like the spokes of a wheel", "spokes"),
    # parts, sides and openings that the picture does not tell
    ("leave the side that looks onto the street open", "street"),
    ("leave room for a cart to pass", "room for"),
    ("from two sides", "two sides"),
    ("only its front", "front"),
    # uneven ones and several groups
    ("most of them at the top", "most of them"),
    ("nearer at the left than at the right", "nearer at"),
    ("alternating close and far", "alternating"),
    ("in three clusters", "clusters"),
    ("in two arcs", "two arcs"),
    ("hold one in reserve", "one in reserve"),
    ("three of them waiting by the gate", "three of them"),
    ("two of them twice as far", "twice"),
    ("seven around and one in the middle", "one in the middle"),
    ("the first at 120,80", "the first"),
    ("robot 2 in front", "robot 2"),
    ("four a side", "four a side"),
    ("half of them looking away", "half"),
    # what to stay off, where it cannot be told from a picture or what was pointed at
    ("mind the cable", "the cable"),
    ("clear of its neighbours", "neighbours"),
    # times, conditions, movements
    ("as soon as the bell rings", "as soon as"),
    ("when it stops", "when it"),
    ("if it rains", "if"),
    ("unless it is locked", "unless"),
    ("after supper", "after supper"),
    ("tomorrow", "tomorrow"),
    ("for twenty minutes", "twenty minutes"),
    ("and follow it", "follow it"),
    ("going round it clockwise", "clockwise"),
    ("then come home", "come home"),
    ("and fill it", "fill it"),
    # the opposite
    ("so that it can get away", "can get away"),
    ("never on its left", "never"),
    ("except under the lamp", "except"),
]


@pytest.mark.parametrize(("words", "quote"), ASKED)
def test_what_is_not_carried_out_is_asked_about_and_quoted(words: str, quote: str) -> None:
    for joint in (", ", "; "):
        question = asked(f"Surround the lid with 8 robots{joint}{words}")
        assert question is not None
        assert quote in question


@pytest.mark.parametrize(
    "words",
    [
        "Do not ring it with 8 robots",
        "Don't ring it with 8 robots",
        "You should never ring it with 8 robots",
        "Under no circumstances ring it with 8 robots",
        "It would be wrong to ring it with 8 robots",
        "Nobody should ring it with 8 robots",
        "Ring it with 8 robots? No, leave it alone",
        "Cancel: ring it with 8 robots",
        "Ring anything but it with 8 robots",
        "Hold off on ringing it with 8 robots",
        "Stop ringing it with 8 robots",
        "Stop the 8 robots from ringing it",
        "8 robots must keep far from it, none around it",
        "Call back the 8 robots around it",
        "Remove the 8 robots around it",
        "What if 8 robots ringed it?",
        "Why are 8 robots around it?",
        "Should 8 robots ring it?",
        "How many of the 8 robots are around it?",
        "Yesterday 8 robots ringed it",
        "Count the 8 robots around it",
        "Take a picture of the 8 robots around it",
        "Hello 8 robots",
        "Move the 8 robots",
    ],
)
def test_nothing_is_placed_where_nobody_said_to(words: str) -> None:
    question = asked(words)
    assert question is not None


@pytest.mark.parametrize(
    "words",
    [
        "Ring the lid and fill it, 8 robots",
        "Ring it or line up along it with 8 robots",
        "Put 8 robots around it and that one too",
        "Put 8 robots around all of the lids",
        "Put 8 robots around each of the lids",
        "Put 8 robots around both lids",
        "Put 8 robots around every lid",
        "Put 8 robots around it and the lid beside it",
        "Put 3 robots on every side of it",
        "Fill the bottom of it with 8 robots",
        "Fill the upper half of it with 8 robots",
        "Cover the left side of the lawn with 8 robots",
        "Line up 8 robots along its left side and along its top",
    ],
)
def test_what_is_more_than_one_arrangement_of_one_thing_is_asked_about(words: str) -> None:
    question = asked(words)
    assert question is not None


def test_a_question_says_what_would_be_done_without_the_words() -> None:
    question = asked("Line up 6 robots along its left side, by starlight")
    assert question is not None
    assert "I would put 6 robots in a row along it" in question
    assert '"by starlight"' in question


def test_metres_take_a_scale() -> None:
    words = "Surround the lid with 8 robots, 2 m away, 1.5 m apart. They are 40 cm across."
    assert len(read_instruction(words).unscaled) == 3
    question = asked(words, scale=None)
    assert question is not None
    assert "Say it in px" in question
    assert asked(words) is None


def test_a_bare_number_is_a_length_only_in_a_picture_without_a_scale() -> None:
    words = "Ring it with 8 robots, 45 away"
    assert asked(words, scale=None) is None
    assert read_instruction(words).group["clearance"] == [45, 46]
    question = asked(words)
    assert question is not None
    assert "45" in question


@pytest.mark.parametrize(
    "words",
    [
        "Surround the coin with 8 robots, the first further out than the others",
        "Form a heart around it with 20 robots",
        "Surround the lid with 8 robots, nearer at the left than at the right",
    ],
)
def test_no_phrase_for_a_thing_takes_up_another_demand(words: str) -> None:
    assert asked(words) is not None
