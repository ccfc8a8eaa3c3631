"""What stands right before a thing outweighs what the rest of a sentence resembles."""

import pytest
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.evidence import weighed


@pytest.mark.parametrize(
    ("words", "relation"),
    [
        ("18 robots are desired around the tennis court which is lying vacant", "around"),
        ("Seven bots are to be deputed round the old weighbridge", "around"),
        ("Twenty robots are required around the helipad on the hospital roof", "around"),
        ("3 robots may be kept between the kettle and the cups", "between"),
        ("6 bots on the vertices of the hexagon", "corners"),
        ("Five on the points of the star", "corners"),
        ("Nine fellows in a row alongside the punt", "along"),
    ],
)
def test_prepositions_say_the_arrangement(words: str, relation: str) -> None:
    reading = read_instruction(words)
    assert reading.relation == relation
    assert reading.sure


@pytest.mark.parametrize(
    "words", ["Fence in the calf with nine robots", "Close in on the lorry, six of you, no gaps"]
)
def test_a_preposition_of_the_verb_says_nothing(words: str) -> None:
    assert read_instruction(words).relation != "inside"


def test_without_evidence_the_probabilities_stay() -> None:
    meaning = {"around": 0.6, "inside": 0.4}
    assert weighed(meaning, ()) == meaning


@pytest.mark.parametrize(
    "words",
    [
        "Eight robots in a circle around the bench. They must not touch it.",
        "Eight robots around the bench, and please do not bump into it.",
    ],
)
def test_what_robots_must_not_do_closes_no_ring(words: str) -> None:
    assert read_instruction(words).relation == "around"


def test_what_nobody_else_may_do_closes_a_ring() -> None:
    words = "Eight robots around the bench so that nobody can touch it"
    assert read_instruction(words).relation == "cage"
