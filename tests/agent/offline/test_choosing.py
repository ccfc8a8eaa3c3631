"""Which thing the words mean on photographs: found, asked about, absent, or chosen."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent, Run
from formup.agent.messages import History, Reply, Result
from formup.tools.context import Settings
from formup.tools.perception.detectors import candidates
from formup.tools.perception.detectors.candidates import find_candidates
from formup.tools.perception.image import Picture, load_picture
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

PHOTOS = Path(__file__).parents[3] / "evals/photos/images"
SIX = Settings(robots=6, may_deploy=False)


@cache
def photo(name: str) -> Picture:
    return load_picture(PHOTOS / name)


@pytest.fixture(autouse=True, scope="module")
def found_once() -> Any:
    """What is in a picture is the same in every test: find it once."""
    known: dict[int, Any] = {}

    def remembered(pixels: Any) -> Any:
        if id(pixels) not in known:
            known[id(pixels)] = find_candidates(pixels)
        return known[id(pixels)]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(candidates, "find_candidates", remembered)
        yield


def run(words: str, name: str = "us_coins.jpg", fixed: Settings = SIX) -> Run:
    return Agent().run(photo(name), words, settings=fixed)


def calls(history: History, name: str) -> list[Any]:
    return [c for m in history if isinstance(m, Reply) for c in m.calls if c.name == name]


def taken(done: Run) -> list[str]:
    """The candidates that the last proposal was about."""
    proposals = calls(done.outcome.messages, "propose_formation")
    return [t["candidate"] for t in proposals[-1].arguments["targets"]] if proposals else []


def is_settled(history: History) -> bool:
    """Whether every candidate proposed was measured to be the one, or chosen by a person."""
    results = [m for m in history if isinstance(m, Result)]
    found = [json.loads(m.text) for m in results if m.name == "locate_object" and not m.error]
    sure = {f["candidates"][0]["id"] for f in found if f.get("settled")}
    pairs = [{c["id"] for c in f["candidates"]} for f in found if len(f["candidates"]) == 2]
    wording = " ".join(m.text for m in results if m.name == "ask_user")
    for proposal in calls(history, "propose_formation"):
        for target in proposal.arguments["targets"]:
            name = target["candidate"]
            if name not in sure.union(*pairs) and name[1:] not in wording:
                return False
    return True


@pytest.mark.parametrize(
    ("words", "relation"),
    [
        ("Surround the biggest coin", "around"),
        pytest.param("Which of these is the largest coin? Surround it.", "around"),
        ("The largest coin needs a ring of robots around it", "around"),
        ("Fill the largest coin", "inside"),
        ("Line up on the largest coin's left side", "along"),
    ],
)
def test_the_thing_that_measures_single_out_is_taken(words: str, relation: str) -> None:
    done = run(words)
    assert done.report.status == "planned"
    assert done.report.contract is not None
    assert done.report.contract.groups[0].relation == relation
    assert len(taken(done)) == 1
    assert is_settled(done.outcome.messages)
    (target,) = done.report.targets
    assert target["box"][2] - target["box"][0] > 100


@pytest.mark.parametrize(
    "words",
    [
        "Surround the coin",
        "Surround the coins",
        "Surround it",
        "Surround the dog",
        "Surround the coin box",
        "Surround the largest coin's shadow",
        "Surround the largest stone",
        "Surround the head on the largest coin",
        "Surround the smallest coin, not the largest",
        "Surround the largest coin and the smallest coin",
        "Look at the largest coin. Surround the other one.",
        "Surround the coin larger than the quarter",
        "Do not surround the largest coin",
        "What surrounds the largest coin?",
        "ümgib die größte Münze",
        "around",
        "?",
    ],
)
def test_what_measures_do_not_single_out_is_asked_about(words: str) -> None:
    done = run(words)
    assert done.report.status == "question"
    assert not taken(done)


def test_a_thing_absent_by_its_look_is_impossible() -> None:
    report = run("Surround the purple triangle").report
    assert report.status == "impossible"
    assert "purple" in report.message


def test_the_question_offers_the_things_that_fit() -> None:
    done = run("Surround the coin")
    offered = calls(done.outcome.messages, "ask_user")[-1].arguments["candidates"]
    assert len(offered) > 3
    assert "c1" in offered


@pytest.mark.parametrize("answer", ["3", "c3", "C3", "number 3", "I mean 3.", " 3 "])
def test_an_answer_chooses(answer: str) -> None:
    done = Agent().resume(run("Surround the coin"), answer=answer)
    assert taken(done) == ["c3"]
    assert is_settled(done.outcome.messages)


@pytest.mark.parametrize(
    "answer",
    ["99", "c99", "0", "-3", "3.5", "3,5", "the 3rd", "3 or 5", "not 3", "neither", "yes", "c"],
)
def test_other_answers_are_asked_again(answer: str) -> None:
    done = Agent().resume(run("Surround the coin"), answer=answer)
    assert done.report.status == "question"
    assert not taken(done)


def test_two_things_are_found_for_between() -> None:
    done = run("Put 3 robots between the red lighter and the white disc", "table_stuff.jpg")
    assert done.report.status in ("planned", "question")
    if done.report.status == "question":
        done = Agent().resume(done, answer="3 and 4")
    assert sorted(taken(done)) == ["c3", "c4"]


def test_between_takes_no_third_choice() -> None:
    asked = run("Put 3 robots in a line between the dog and the cat")
    done = Agent().resume(asked, answer="1, 2 and 3")
    assert done.report.status == "question"


WORDS = """
surround cage fill line up along around between the a of two second last other not and or than
that which is isn't it its copper silver largest small round coin coins thing dog left right
top of below nearest in on at by with 4 robots , . ?
"""
SALAD = st.lists(st.sampled_from(WORDS.split()), min_size=1, max_size=14).map(" ".join)


@settings(
    deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(SALAD)
def test_no_words_place_robots_about_a_thing_that_is_not_settled(words: str) -> None:
    done = run(f"Surround {words}")
    assert done.report.status in ("planned", "question", "impossible")
    assert is_settled(done.outcome.messages)
