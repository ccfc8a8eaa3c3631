"""The list of fillers is short and holds function words alone; other languages are asked about."""

import pytest
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import question_of
from formup.agent.offline.lexicon import WEIGHTY, fillers
from formup.tools.formation.number_words import GROUPS, PARTS, SCALES, SMALL, TENS

MOST_FILLERS = 150
PREPOSITIONS = """
about above across after against along alongside amid among around as at atop before behind below
beneath beside besides between beyond by down during except for from in inside into near next of
off on onto opposite out outside over past per round since than through throughout till to toward
towards under underneath until up upon via with within without
""".split()  # noqa: SIM905
NOUNS_AND_ADJECTIVES = """
robot robots thing things side edge corner middle centre ring circle row line gap distance place
way time left right top bottom front back big small large little long short tight wide close near
far even same other first last next red open free clear empty full whole half
""".split()  # noqa: SIM905
SAID_OF_NOTHING = ("as", "but")
"""Conjunctions that are prepositions elsewhere."""


def test_fillers_are_few_and_stand_once() -> None:
    assert 50 < len(fillers()) <= MOST_FILLERS


@pytest.mark.parametrize(
    "words",
    [
        PREPOSITIONS,
        NOUNS_AND_ADJECTIVES,
        [*SMALL, *TENS, *SCALES, *GROUPS, *PARTS],
        sorted(WEIGHTY),
    ],
)
def test_no_filler_says_how_many_where_or_what(words: list[str]) -> None:
    assert fillers() & set(words) <= set(SAID_OF_NOTHING)


FOREIGN = [
    "Stelle acht Roboter um die Tasse",
    "Bitte 8 Roboter im Kreis um den Teller aufstellen",
    "Place 8 robots autour de la tasse",
    "Entoure l'assiette avec huit robots",
    "Pon 8 robots alrededor del plato",
    "Rodea la taza con ocho robots",
    "\u5728\u676f\u5b50\u5468\u56f4\u653e8\u4e2a\u673a\u5668\u4eba",
    "\u7528\u516b\u4e2a\u673a\u5668\u4eba\u56f4\u4f4f\u76d8\u5b50",
]


def asked(words: str) -> str | None:
    task = Task(words, 8, (), ("t1",), True, None)
    return question_of(task, read_instruction(words), 8)


@pytest.mark.parametrize("words", FOREIGN)
def test_an_instruction_in_another_language_is_asked_about(words: str) -> None:
    assert asked(words)


@pytest.mark.parametrize("words", FOREIGN)
def test_the_question_says_that_only_english_is_read(words: str) -> None:
    assert "English" in (asked(words) or "")
