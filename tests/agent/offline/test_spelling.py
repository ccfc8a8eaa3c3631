import pytest
from formup.agent.offline.spelling import spelled


@pytest.mark.parametrize(
    "words",
    [
        "surround the fork with 5 robots",
        "around the red tine",
        "move to the sand",
        "surround the wire",
        "half of them around another boot",
        "at the corners of the shop",
        "along my leash",
        "around the big fork",
        "surround the shrine",
        "behind the painting",
        "in the hallway",
    ],
)
def test_the_name_of_a_thing_is_no_slip(words: str) -> None:
    assert spelled(words) == words


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("go round the lfet sied", "go round the left side"),
        ("move the coin furhter", "move the coin further"),
        ("in the midle", "in the middle"),
        ("at the conrers", "at the corners"),
        ("leave a gpa at the botom", "leave a gap at the bottom"),
        ("robot 3 to the rigth", "robot 3 to the right"),
        ("the numbre of robbots", "the number of robots"),
    ],
)
def test_a_slip_is_put_right(typed: str, meant: str) -> None:
    assert spelled(typed) == meant


@pytest.mark.parametrize(
    "words",
    ["roger", "it is boring", "save some room for my wife", "that was a shame", "the whole world"],
)
def test_a_word_of_everyday_english_is_no_slip(words: str) -> None:
    assert spelled(words) == words
