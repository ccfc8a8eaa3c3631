"""The offline planner and drawn forms: what is read, where it goes, and what it still refuses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drawn_forms import form_in
from formup.agent.report import Report
from formup.tools.context import Settings
from formup.tools.perception.image import Picture, load_picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

PHOTOS = Path(__file__).parents[3] / "evals/photos/images"
COIN = TargetPrompt(box=(176, 188, 292, 298))
FAULT = pytest.mark.xfail(strict=True, reason="a known fault of the reading")
OUTLINED = {"kind": "outlined_letters"}


@pytest.mark.parametrize(
    ("words", "shape", "robots", "rest"),
    [
        ("form a star around it", {"kind": "star"}, None, "around it"),
        ("10 robots in a star around it", {"kind": "star"}, None, "10 robots around it"),
        ("draw a six-pointed star in it", {"kind": "star", "corners": 6}, None, "in it"),
        ("make a hexagon round it", {"kind": "polygon", "corners": 6}, None, "round it"),
        ("spell A above it", {"kind": "letters", "text": "A"}, None, "above it"),
        ("spell out 'hi' left of it", {"kind": "letters", "text": "HI"}, None, "left of it"),
        ("write HELLO below it", {"kind": "letters", "text": "HELLO"}, None, "below it"),
        ("form the number 42 above it", {"kind": "letters", "text": "42"}, None, "above it"),
        ("spell 'Go' in outlined letters above it", OUTLINED | {"text": "Go"}, None, "above it"),
        ("spell 'C3-PO!' in outline in it", OUTLINED | {"text": "C3-PO!"}, None, "in it"),
        ("form the outlined word GO below it", OUTLINED | {"text": "GO"}, None, "below it"),
        ("write OUTLINE above it", {"kind": "letters", "text": "OUTLINE"}, None, "above it"),
        ("in a 3 by 4 grid beside it", {"kind": "grid", "rows": 3}, 12, "beside it"),
        ("make a 2x5 grid in it", {"kind": "grid", "rows": 2}, 10, "in it"),
        ("robots in a grid of two by six in it", {"kind": "grid", "rows": 2}, 12, "robots in it"),
        ("arrange them in a grid in it", {"kind": "grid"}, None, "arrange them in it"),
    ],
)
def test_plain_wordings_name_a_form(
    words: str, shape: dict[str, Any], robots: int | None, rest: str
) -> None:
    form, (start, end) = form_in(words)
    assert form is not None
    assert (form.shape, form.robots) == (shape, robots)
    assert " ".join((words[:start] + words[end:]).split()) == rest


@pytest.mark.parametrize(
    "words",
    [
        "surround the star",
        "surround a star",
        "surround the cookie in the shape of a star",
        "surround the coin with a star on it",
        "spell hello above it",
        "spell 'hello!' above it",
        "form a heart around it",
        "form a star of the coins",
        "make a 3.5 by 4 grid",
        "spell it out",
        "write down the number of coins",
    ],
)
def test_other_words_name_none(words: str) -> None:
    assert form_in(words) == (None, (0, 0))


@pytest.mark.parametrize(
    ("words", "things", "faced"),
    [
        (
            "line up 5 robots along the side of the red car facing the blue car",
            ["the red car"],
            "the blue car",
        ),
        ("stand on its side nearest the road, 4 robots in a row", [], "the road"),
    ],
)
def test_what_a_side_faces_is_told_apart(words: str, things: list[str], faced: str) -> None:
    reading = read_instruction(words)
    assert (reading.relation, reading.things, reading.faced) == ("along", things, faced)


def drawn(*boxes: tuple[int, int, int, int]) -> Picture:
    """Red boxes on grey, 640 x 480 px."""
    pixels = np.full((480, 640, 3), 170, np.uint8)
    for x0, y0, x1, y1 in boxes:
        pixels[y0:y1, x0:x1] = (200, 30, 40)
    return picture_from_array(pixels)


@pytest.mark.parametrize(
    "words",
    ["surround the clock face", "surround the grid", "surround the one pointing another way"],
)
def test_such_words_about_the_thing_are_no_form(words: str) -> None:
    reading = read_instruction(words)
    assert (reading.relation, reading.form, reading.unread) == ("around", None, [])


def run(instruction: str, picture: Picture | None = None, **more: Any) -> Report:
    shown = load_picture(PHOTOS / "us_coins.jpg") if picture is None else picture
    return Agent().run(shown, instruction, **more).report


@pytest.mark.parametrize(
    ("words", "where", "count"),
    [
        ("form a star around it with 15 robots", "around", 15),
        ("10 robots in a triangle around it", "around", 10),
        pytest.param("spell L with 9 robots right of it", "right", 9),
        pytest.param("a dozen robots in a 3 by 4 grid inside it", "inside", 12),
        ("in a 2 by 3 grid beside it", "right", 6),
        ("surround it: form a hexagon of 12 robots", "around", 12),
        pytest.param("spell 'R2-D2!' in outlined letters below it with 90 robots", "below", 90),
    ],
)
def test_a_form_is_placed_where_the_words_say(words: str, where: str, count: int) -> None:
    report = run(words, pointed=[COIN])
    assert report.status == "deployed", report.message
    assert report.contract is not None
    (group,) = report.contract.groups
    assert group.shape is not None
    assert (group.relation, group.shape.where, group.robots) == ("shape", where, count)


def test_beside_a_thing_at_the_border_is_on_another_side_of_it() -> None:
    box = (540, 200, 640, 280)
    target = TargetPrompt(box=box)
    report = run("6 robots in a 2 by 3 grid beside it", drawn(box), pointed=[target])
    assert report.status == "deployed", report.message
    assert report.contract is not None and report.contract.groups[0].shape is not None
    assert report.contract.groups[0].shape.where == "left"


@FAULT
def test_the_side_of_one_thing_that_faces_another() -> None:
    boxes = (60, 160, 200, 260), (400, 160, 520, 260)
    pointed = [TargetPrompt(id=f"t{i}", box=box) for i, box in enumerate(boxes, start=1)]
    words = "Line up 4 robots along this one, all facing that one"
    report = run(words, drawn(*boxes), pointed=pointed)
    assert report.status == "deployed", report.message
    assert report.contract is not None and report.positions is not None
    (group,) = report.contract.groups
    assert (group.relation, group.targets, group.facing) == ("along", ("t1",), "t2")
    assert all(200 < x < 400 for x, _ in report.positions)
    alone = run(words, drawn(*boxes), pointed=pointed[:1])
    assert alone.status == "question"
    assert "Point at both" in alone.message


@pytest.mark.parametrize(
    ("words", "wording"),
    [
        pytest.param("form a star with 10 robots", "Where are the robots to draw a star?"),
        ("spell A around it with 9 robots", "Where are the robots to draw the letters A?"),
        pytest.param("9 robots in a 3 by 4 grid inside it", "takes 12 robots, 9 were named"),
        ("surround it with 6 robots, all facing the coin", 'Which one is "the coin"?'),
        ("spell hello above it with 20 robots", "form"),
        ("form a heart around it with 20 robots", "form"),
        ("20 robots in a 3.5 by 4 grid inside it", '"in a 3.5 by 4 grid inside it"'),
    ],
)
def test_what_is_not_understood_is_asked_about(words: str, wording: str) -> None:
    report = run(words, pointed=[COIN], settings=Settings())
    assert report.status == "question"
    assert wording in report.message
