"""Answers to questions about a first instruction: what they count for, and what is still asked."""

import pytest
from formup.agent.agent import Agent
from formup.agent.first_message import Task
from formup.agent.offline.restated import LEFT_OUT, restated
from formup.agent.session import Run
from formup.tools.context import Settings
from formup.tools.perception.image import Picture
from formup.tools.perception.target_prompt import TargetPrompt

RED, BLUE = TargetPrompt(points=((250, 220),)), TargetPrompt(points=((560, 300),))
PLAN = Settings(may_deploy=False)


def task(words: str) -> Task:
    return Task(instruction=words, robots=None, pointed=(), targets=("t1",), deploy=False)


def said(words: str, *answers: str) -> str:
    return " ".join(restated(task(words), answers).text.split())


@pytest.mark.parametrize(
    ("answers", "text"),
    [
        (["no, wait, nine"], "9 robots around it on the left, blorp"),
        (["make that twelve"], "12 robots around it on the left, blorp"),
        (["no, on the right instead"], "6 robots around it on the right, blorp"),
        (["i meant the top rather than the left"], "6 robots around it on the top, blorp"),
        (["how many are there?"], "6 robots around it on the left, blorp"),
    ],
)
def test_a_correction_takes_the_place_of_what_it_corrects(answers: list[str], text: str) -> None:
    found = said("6 robots around it on the left, blorp", *answers)
    assert found.replace("nine", "9").replace("twelve", "12") == text


def test_an_answer_counts_for_no_number_or_side_that_it_does_not_speak_of() -> None:
    told = restated(task("6 robots around it, blorp twenty of them"), ["evenly spaced"])
    assert any("twenty" in words for words in told.open)
    told = restated(task("6 robots around it, blorp twenty"), ["20 px from it"])
    assert (told.open, bool(told.left_out)) == ((), True)


@pytest.mark.parametrize(
    "words", ["leave it out", "ok, just ignore that", "Forget about it please."]
)
def test_what_is_not_understood_can_be_left_out(words: str) -> None:
    assert LEFT_OUT.fullmatch(words)
    assert not LEFT_OUT.fullmatch(f"{words} and add two")


@pytest.fixture
def asked(picture: Picture) -> Run:
    """A first instruction with words that nobody knows."""
    words = "surround it with 6 robots, 20 px away, blorpwise"
    return Agent().run(picture, words, settings=PLAN, pointed=[RED])


def test_a_question_of_the_person_s_own_is_no_answer(asked: Run) -> None:
    again = Agent().resume(asked, answer="how wide is the gap?")
    assert again.report.status == "question"
    assert "Nothing stands yet" in again.report.message
    assert '"blorpwise"' in again.report.message
    done = Agent().resume(again, answer="leave it out").report
    assert (done.status, len(done.positions or ())) == ("planned", 6)


def test_what_an_answer_was_taken_for_is_told(asked: Run) -> None:
    again = Agent().resume(asked, answer="blimpwise")
    assert '"blorpwise"' in again.report.message
    assert '"blimpwise"' in again.report.message
    done = Agent().resume(again, answer="evenly spaced").report
    assert done.status == "planned"
    assert 'left out, for what was answered: "blorpwise", "blimpwise"' in done.message


def test_of_two_things_one_is_stood_about(picture: Picture) -> None:
    pointed = [RED, BLUE.model_copy(update={"id": "t2"})]
    made = Agent().run(picture, "4 robots in a line between them", settings=PLAN, pointed=pointed)
    for words, target in (("around the right one instead", "t2"), ("around the left one", "t1")):
        made = Agent().say(made, words, settings=PLAN)
        assert made.report.contract is not None
        assert made.report.contract.groups[0].targets == (target,)
