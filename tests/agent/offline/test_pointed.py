"""Which of several things pointed at is meant; a quantity over all of them is never dropped."""

import json
from pathlib import Path

import pytest
from formup.agent.agent import Agent
from formup.agent.session import Run
from formup.tools.perception.image import load_picture
from formup.tools.perception.target_prompt import TargetPrompt

PHOTOS = Path(__file__).parents[3] / "evals" / "photos"


def said_of_both_courts(words: str) -> Run:
    entries = json.loads((PHOTOS / "annotations.json").read_text("utf-8"))
    entry = next(e for e in entries if "tenniscourt30" in e["image"])
    outlines = {o["id"]: o["polygon"] for o in entry["objects"]}
    pointed = [
        TargetPrompt(id=f"t{k}", outline=tuple((x, y) for x, y in outlines[name][:30]))
        for k, name in enumerate(("left_court", "right_court"), start=1)
    ]
    return Agent().start(load_picture(PHOTOS / entry["image"]), pointed=pointed).say(words)


@pytest.mark.parametrize(
    "words",
    [
        "Would you put two robots inside each court, please?",
        "put two robots inside every court",
        "4 robots, half inside each",
    ],
)
def test_what_is_said_of_each_is_done_for_each(words: str) -> None:
    run = said_of_both_courts(words)
    assert run.report.status == "planned"
    assert run.report.contract is not None
    told = [(g.relation, g.targets, g.robots) for g in run.report.contract.groups]
    assert told == [("inside", ("t1",), 2), ("inside", ("t2",), 2)]


@pytest.mark.parametrize("words", ["4 robots inside both of the courts", "1 robot, half in each"])
def test_what_is_said_of_each_is_not_done_for_one(words: str) -> None:
    run = said_of_both_courts(words)
    assert run.report.status == "question"
    assert run.report.plan_id is None


def test_the_one_that_words_single_out_is_taken() -> None:
    run = said_of_both_courts("put two robots inside the right court")
    assert run.report.status == "planned"
    assert run.report.contract is not None
    assert run.report.contract.groups[0].targets == ("t2",)
