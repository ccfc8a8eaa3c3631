"""Questions that name alternatives take each by its words, its number and its rank."""

from pathlib import Path

import numpy as np
import pytest
from formup.agent.agent import Agent, Run
from formup.agent.offline.options import option_chosen
from formup.tools.context import Settings
from formup.tools.perception.image import Picture, load_picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

PHOTOS = Path(__file__).parents[3] / "evals/photos/images"
PLAN = Settings(may_deploy=False)
RED, BLUE, GREEN = (60, 40), (360, 200), (300, 40)
SHOWN = (TargetPrompt(id="t1", points=((90, 60),)), TargetPrompt(id="t2", points=((390, 220),)))


@pytest.fixture(scope="module")
def picture() -> Picture:
    pixels = np.full((300, 480, 3), 60, np.uint8)
    for (x, y), colour in ((RED, (200, 40, 40)), (BLUE, (40, 60, 210)), (GREEN, (40, 170, 60))):
        pixels[y : y + 50, x : x + 60] = colour
    return picture_from_array(pixels)


def answered(asked: Run, answer: str) -> Run:
    assert asked.report.status == "question"
    assert asked.report.options
    return Agent().resume(asked, answer=answer)


@pytest.mark.parametrize(
    ("answer", "place"),
    [
        ("the red thing", RED),
        ("red one please", RED),
        ("1", RED),
        ("the first", RED),
        ("I mean the blue thing", BLUE),
        ("2", BLUE),
        ("number 2", BLUE),
        ("the second one", BLUE),
        ("the last", BLUE),
        ("the green one", GREEN),
    ],
)
def test_either_of_two_things_named(picture: Picture, answer: str, place: tuple[int, int]) -> None:
    words = "surround the red thing the blue thing with 4 robots"
    done = answered(Agent().run(picture, words, settings=PLAN), answer).report
    assert done.status == "planned"
    assert done.targets[0]["box"][:2] == pytest.approx(place, abs=3)


@pytest.mark.parametrize("answer", ["both", "c3", "not the red one", "3", "hm"])
def test_what_chooses_neither_is_asked_again(picture: Picture, answer: str) -> None:
    words = "surround the red thing the blue thing with 4 robots"
    again = answered(Agent().run(picture, words, settings=PLAN), answer).report
    assert again.message.startswith(f'"{answer}" is none of them. Which thing')
    assert again.options == ("the red thing", "the blue thing")


@pytest.mark.parametrize("answer", ["2", "the second one", "the last", "closed ring around it"])
def test_either_of_two_arrangements(picture: Picture, answer: str) -> None:
    asked = Agent().run(picture, "put 4 robots by the red thing", settings=PLAN)
    assert "1: inside it, spread evenly; 2: in a closed ring around it." in asked.report.message
    done = answered(asked, answer).report
    assert (done.status, len(done.positions or ())) == ("planned", 4)
    assert done.contract is not None
    assert done.contract.groups[0].relation == "cage"


@pytest.mark.parametrize("answer", ["t2", "2", "the second one", "the last", "the blue one"])
def test_either_of_two_things_pointed_at(picture: Picture, answer: str) -> None:
    asked = Agent().run(picture, "surround it with 4 robots", settings=PLAN, pointed=SHOWN)
    done = answered(asked, answer).report
    assert done.contract is not None
    assert done.contract.groups[0].targets == ("t2",)


@pytest.mark.parametrize(
    ("answer", "area"), [("the white one", 9936), ("grey oval", 5210), ("the grey one", None)]
)
def test_a_candidate_by_what_only_it_is_called(answer: str, area: int | None) -> None:
    coin = load_picture(PHOTOS / "table_stuff.jpg")
    asked = Agent().run(coin, "put 5 robots around the coin", settings=PLAN)
    chosen = {c["area_px"]: c["box"] for c in asked.report.candidates or ()}
    done = Agent().resume(asked, answer=answer).report
    assert done.status == ("planned" if area else "question")
    if area:
        assert done.targets[0]["box"] == pytest.approx(chosen[area], abs=4)


def test_an_option_is_chosen_by_what_only_it_says() -> None:
    options = ("robot 3 a bit to the left", "robot 4 a bit to the left")
    assert option_chosen("robot 4", options) == options[1]
    assert option_chosen("to the left", options) is None
    assert option_chosen("the second one, please", options) == options[1]
    assert option_chosen("", options) is None


def test_a_number_of_robots_and_a_side_choose_no_candidate(picture: Picture) -> None:
    session = Agent().start(picture)
    plan = session.say("surround the red thing with 5 robots").report.plan_id
    assert session.say("put 2 over there").report.candidates
    again = session.say("2 to the left").report
    assert (again.status, again.plan_id) == ("question", plan)
    assert session.say("the left one").report.targets[-1]["box"][:2] == pytest.approx(GREEN, abs=3)
