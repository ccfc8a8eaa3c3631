"""Things that robots look at or an opening is towards, parts at distances of their own, widths."""

import math
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.conversation import Session
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import contract_of
from formup.agent.offline.spelling import normalized_instruction
from formup.agent.report import Report
from formup.tools.context import Settings
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

SHOWN = (TargetPrompt(id="t1", box=(198, 118, 262, 182)),)


@pytest.fixture(scope="module")
def picture() -> Picture:
    pixels = np.full((300, 480, 3), 60, np.uint8)
    pixels[120:180, 200:260] = (200, 40, 40)
    pixels[125:175, 400:450] = (40, 170, 60)
    return picture_from_array(pixels)


def planned(picture: Picture, words: str, **settings: Any) -> Report:
    given = Settings(may_deploy=False, **settings)
    report = Agent().run(picture, words, settings=given, pointed=SHOWN).report
    assert report.status == "planned", report.message
    return report


@pytest.mark.parametrize(
    "words",
    [
        "surround it with 6 robots, leaving a gap towards the green thing",
        "6 robots around it, open towards the green thing",
        "put 6 robots around it with a 40 px opening facing the green thing",
    ],
)
def test_an_opening_is_towards_another_thing(picture: Picture, words: str) -> None:
    report = planned(picture, words)
    assert report.contract is not None
    group = report.contract.groups[0]
    assert group.opening_towards in {t["id"] for t in report.targets} - {"t1"}
    directions = [math.atan2(y - 150, x - 230) for x, y in report.positions or ()]
    assert min(map(abs, directions)) > math.radians(15)


def test_robots_look_at_another_thing(picture: Picture) -> None:
    report = planned(picture, "surround it with 6 robots, all facing the green thing")
    for (x, y), heading in zip(report.positions or (), report.headings_deg or (), strict=True):
        assert heading is not None
        along = math.tan(math.radians(heading))
        assert abs(heading) < 90 or heading > 270
        assert 124 <= y + along * (400 - x) <= 176


@pytest.mark.parametrize(
    ("words", "aims", "heading"),
    [
        ("surround the car with 5 robots facing the tree", {"heading": "the tree"}, None),
        ("6 robots left of the stage, all facing the audience", {"heading": "the audience"}, None),
        (
            "6 robots around the bed, leaving the door side free",
            {"opening_towards": "the door"},
            None,
        ),
        ("5 robots around the car, facing the car", {}, "towards"),
        ("ring of 6, 35 px, all facing the vase", {}, "towards"),
        ("three left of the box, three right of it, each looking at the box", {}, "towards"),
        ("4 robots at the corners of the case, backs to the glass", {}, "away"),
        ("6 robots around it, looking towards the exterior", {}, "away"),
    ],
)
def test_what_is_looked_at(words: str, aims: dict[str, str], heading: str | None) -> None:
    reading = read_instruction(words)
    assert not reading.unread
    assert (reading.aims, reading.group.get("heading")) == (aims, heading)


def test_what_only_describes_a_side_or_a_thing_is_no_heading() -> None:
    for words in (
        "surround it with 7 robots and leave the side that looks onto the street open",
        "surround the statue facing the street with 7 robots",
    ):
        assert "heading" not in read_instruction(words).aims


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (
            "3 robots on the left 20 px away and 2 on the right, 50 px away",
            [("left", 3, [20, 21]), ("right", 2, [50, 51])],
        ),
        (
            "2 on the left and 3 on the right, 40 px away",
            [("left", 2, [40, 41]), ("right", 3, [40, 41])],
        ),
        (
            "2 robots 30 px to the left of it and 3 below it",
            [("left", 2, [30, 31]), ("bottom", 3, None)],
        ),
        (
            "Six robots on the left, four on the right. The left ones 20 px away and the right "
            "ones at least 35.",
            [("left", 6, [20, 21]), ("right", 4, [35, 100_000])],
        ),
        ("left side three, right side three", [("left", 3, None), ("right", 3, None)]),
        (
            "half of the robots go left of the desk and the other half right of it",
            [("left", 3, None), ("right", 3, None)],
        ),
    ],
)
def test_parts_of_a_team_have_distances_of_their_own(words: str, parts: list[Any]) -> None:
    reading = read_instruction(words)
    assert not reading.unread
    groups = contract_of(reading, reading.robots or 6, ["t1"], [])["groups"]
    assert [(g["side"], g["robots"], g.get("clearance")) for g in groups] == parts


@pytest.mark.parametrize("words", ["3 on the left 20 px away 30 px away and 2 on the right"])
def test_two_distances_of_one_part_are_asked_about(words: str) -> None:
    assert read_instruction(words).unread


def test_widths_of_a_robot_are_measured_by_its_radius(picture: Picture) -> None:
    words = "surround it with 6 robots, two robot widths away from it"
    contract = planned(picture, words, robot_radius=5.0).contract
    assert contract is not None
    assert contract.groups[0].clearance == pytest.approx((20, 20), abs=2)


def test_widths_of_a_robot_are_asked_about_where_nothing_says_them(picture: Picture) -> None:
    session = Session(Agent(), picture, pointed=SHOWN)
    asked = session.say("surround it with 6 robots, two robot widths away from it").report
    assert asked.message.startswith('"two robot widths" cannot be measured')
    contract = session.say("8 px").report.contract
    assert contract is not None
    assert contract.groups[0].clearance == pytest.approx((16, 16), abs=2)
    further = session.say("half a robot width further out").report
    assert further.status == "question"
    contract = session.say("8").report.contract
    assert contract is not None
    assert contract.groups[0].clearance == pytest.approx((20, 20), abs=2)


@pytest.mark.parametrize(
    ("words", "other", "far"),
    [
        (
            "12 around the table, and keep at least 40 px away from the flower arch",
            "the flower arch",
            40,
        ),
        ("ring of 9 around the coin, 25 px, but nothing within 40 px of the tree", "the tree", 40),
        ("surround it with 8 robots, stay 50 px clear of the trucks", "the trucks", 50),
        ("8 robots around the car and keep clear of the tree by 30 px", "the tree", 30),
        ("8 around the pond, nobody may come within 20 px of the bench", "the bench", 20),
        ("six around the float, and give the sun lounger a wide berth", "the sun lounger", 0),
    ],
)
def test_a_distance_from_another_thing_is_kept(words: str, other: str, far: float) -> None:
    reading = read_instruction(words)
    assert not reading.unread
    assert (reading.others, reading.keep_out_clearance) == ([other], far)
    assert reading.group.get("clearance") != [far, far + 1]


@pytest.mark.parametrize(
    "words", ["ring it but leave the top open, 7 of you", "7 around it, keep the top side free"]
)
def test_a_side_that_is_left_open_is_no_thing(words: str) -> None:
    reading = read_instruction(words)
    assert not reading.unread
    assert (reading.things, reading.group["sides"]) == ([], ["left", "right", "bottom"])


@pytest.mark.parametrize(
    "words",
    [
        "8 robots round it, nobody nearer than 25 px to the blades",
        "6 robots around the car, no closer than 25 px to the car",
        "6 robots around it, keep at least 25 px away from it",
    ],
)
def test_a_distance_from_the_thing_itself_is_its_clearance(words: str) -> None:
    reading = read_instruction(words)
    assert not reading.unread
    assert (reading.others, reading.group["clearance"][0]) == ([], 25)


def test_robots_stand_and_drive_so_far_off_what_is_kept_free(picture: Picture) -> None:
    near = planned(picture, "surround it with 8 robots, 60 to 100 px away").positions
    words = "surround it with 8 robots, 60 to 100 px away, stay 70 px clear of the green thing"
    report = planned(picture, words)
    assert report.contract is not None
    assert report.contract.keep_out_clearance == 70
    assert min(400 - x for x, _ in near or ()) < 70
    off = [
        math.hypot(max(400 - x, x - 450, 0), max(125 - y, y - 175, 0))
        for x, y in report.positions or ()
    ]
    assert min(off) >= 69.5


@pytest.mark.parametrize(
    ("words", "relation", "field"),
    [
        ("a line from the lifeguard tower to the boat, ten robots", "between", {}),
        ("seven robots in a curved line below the wheelchair", "shape", {"side": "bottom"}),
        ("square formation with 16 right of the drone", "shape", {"side": "right"}),
        (
            "can you build a jail for the dinosaur so he can't escape?",
            "cage",
            {"closure": "escape-proof"},
        ),
        ("keep people off the wet patch, 6 robots. All the way round.", "cage", {}),
        ("four guards on the water side of the towel", "along", {}),
        ("six of them in the side left of the table", "along", {"side": "left"}),
        (
            "6 robots around it, a gap on the right, the rest is closed",
            "around",
            {"opening": 0.0, "opening_towards": "right"},
        ),
    ],
)
def test_arrangements_as_strangers_say_them(
    words: str, relation: str, field: dict[str, Any]
) -> None:
    reading = read_instruction(normalized_instruction(words))
    assert not reading.unread
    assert (reading.relation, reading.group | field) == (relation, reading.group)


@pytest.mark.parametrize(
    "words",
    [
        "guests should see two straight rows, one on each long side of the carpet",
        "the planks need a ring, three robots clear",
        "6 robots around it, the rest is closed",
        "ten around the boat with the bow side open. bow is on the right",
        "5 in a diagonal left of this",
        "5 left of this, rising to the right",
        "three in a wedge left of it, pointing at it",
        "I need traffic held back on the left: a line of six beside the wreck, facing left.",
    ],
)
def test_what_changes_the_arrangement_is_no_background(words: str) -> None:
    assert read_instruction(words).unread


def test_a_correction_within_a_line_is_asked_about() -> None:
    words = "two rows... sorry, one row of six above the stage, all facing it"
    assert read_instruction(normalized_instruction(words)).stops
