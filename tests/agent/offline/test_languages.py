"""Instructions in other languages than English are refused by the name of the language."""

import pytest
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import question_of
from formup.agent.offline.languages import foreign_language
from formup.evals.wordings.sentences import shipped_sentences


@pytest.mark.parametrize(
    ("text", "language"),
    [
        ("Stellt acht Roboter um den Brunnen", "German"),
        ("Placez huit robots autour de la fontaine", "French"),
        ("Pon ocho robots alrededor de la fuente", "Spanish"),
        ("Metti otto robot intorno alla fontana", "Italian"),
        ("Coloque oito robôs ao redor da fonte", "Portuguese"),
        ("Zet acht robots rond het standbeeld", "Dutch"),
        ("用八个机器人围住喷泉", "Chinese"),
        ("Поставь 8 роботов вокруг фонтана", "Cyrillic"),
    ],
)
def test_another_language_is_named(text: str, language: str) -> None:
    task = Task(text, None, (), ("t1",), True, None)
    question = question_of(task, read_instruction(text), 8)
    assert question is not None
    assert language in question
    assert "English" in question


def test_no_english_sentence_is_taken_for_another_language() -> None:
    taken = [s.text for s in shipped_sentences() if foreign_language([w.text for w in s.words])]
    assert taken == []
