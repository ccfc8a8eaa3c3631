"""Plain words of an instruction against the contract, on every wording there is in the suites."""

from pathlib import Path
from typing import Any

import formup
import pytest
import yaml
from formup.evals.tasks.suites import load_suite
from formup.tools.formation.checking.instruction_doubts import doubts
from formup.tools.formation.contract import Contract

WORDINGS = Path(formup.__file__).parent / "evals/scenes/wordings.yaml"
RELATIONS = {"side": "along", "cage": "cage", "center": "centre", "line_between": "between"}


def contract(relation: str, robots: int = 4, **more: Any) -> Contract:
    targets = ("t1", "t2") if relation == "between" else ("t1",)
    if relation == "along":
        more |= {"side": "left"}
    group = {"relation": relation, "targets": targets, "robots": robots, **more}
    return Contract.model_validate({"groups": [group]})


@pytest.mark.parametrize(
    ("instruction", "relation", "word"),
    [
        ("Surround the red car at the corners.", "around", "corners"),
        ("One robot just off each corner of the left court.", "along", "corners"),
        ("Fill the pool with 4 robots", "around", "fill"),
        ("Cage the largest coin.", "around", "cage"),
        ("IMPRISON  the\norange sweet", "corners", "cage"),
        ("Surround the coin", "inside", "surround"),
    ],
)
def test_a_contract_that_says_something_else_is_doubted(
    instruction: str, relation: str, word: str
) -> None:
    (doubt,) = doubts(instruction, contract(relation))
    assert f"'{word}'" in doubt


@pytest.mark.parametrize(
    ("instruction", "relation"),
    [
        ("Surround the car, but not at the corners", "around"),
        ("Don't fill the pool: stand around it", "around"),
        ("Surround the car in the corner of the picture", "around"),
        ("Fill in the gap between the two cars", "between"),
        ("The car near the corner: 4 robots along its left", "along"),
        ("Стань вокруг монеты", "inside"),
        ("", "inside"),
    ],
)
def test_words_that_mean_something_else_are_left_alone(instruction: str, relation: str) -> None:
    assert doubts(instruction, contract(relation)) == []


@pytest.mark.parametrize(
    ("instruction", "robots", "doubted"),
    [
        ("Put six robots around it", 6, False),
        ("Put six robots around it", 5, True),
        ("Put 3 robots on the left and 4 robots on the right", 7, False),
        ("Put 3 robots on the left and 4 robots on the right", 4, False),
        ("Put 3 robots on the left and 4 robots on the right", 5, True),
        ("12 small robots in a ring", 11, True),
        ("one robot at each side", 4, False),
        ("Surround the 3 coins", 4, False),
    ],
)
def test_the_number_of_robots(instruction: str, robots: int, doubted: bool) -> None:
    made = contract("around", robots)
    assert bool(doubts(instruction, made)) == doubted
    assert doubts(instruction, made, counted=True) == []


def test_no_photograph_of_the_suite_is_doubted_when_read_rightly() -> None:
    for task in load_suite("photos").tasks:
        rule = task.goals[0].success
        where = str(rule["where"]).partition(":")[0]
        relation = RELATIONS.get(where, "around" if where == "boundary" else where)
        relation = "cage" if rule.get("closed") else relation
        assert task.robots is not None
        assert doubts(task.instruction, contract(relation, task.robots)) == [], task.instruction


def test_no_wording_of_the_drawn_scenes_is_doubted_when_read_rightly() -> None:
    arrangements = yaml.safe_load(WORDINGS.read_text())["arrangements"]
    filled = {"n": "six", "thing": "the red box", "side": "left"}
    checked = 0
    for name, templates in arrangements.items():
        relation = RELATIONS.get(str(name), str(name))
        for template in templates:
            text = template.format_map(filled)
            assert doubts(text, contract(relation, 6)) == [], text
            checked += 1
    assert checked >= 40
