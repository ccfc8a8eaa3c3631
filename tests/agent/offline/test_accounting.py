"""Instructions in our own words to the fields of the contract that they mean."""

from typing import Any

import pytest
from formup.agent.first_message import Task
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import contract_of, question_of, things_needed
from formup.agent.offline.reading import Reading
from formup.evals.tasks.suites import load_suite
from formup.tools.formation.contract import Contract

SCALE = 0.05
"""Metres per pixel of the pictures that the instructions are read for."""


def read(words: str, robots: int | None = None) -> tuple[Reading, str | None]:
    """The reading of an instruction about a thing that is pointed at, and what is asked."""
    reading = read_instruction(words, SCALE)
    targets = ("t1", "t2")[: things_needed(reading)]
    count = robots or reading.robots or (reading.form.robots if reading.form else None)
    return reading, question_of(Task(words, robots, (), targets, True, SCALE), reading, count)


@pytest.mark.parametrize(
    ("words", "relation"),
    [
        ("Surround the van at the corners", "corners"),
        ("Place one robot at each corner of the shed", "corners"),
        ("Station a robot on every corner of the court", "corners"),
        ("Encircle it", "around"),
        ("Make a ring of 12 robots round the bunker", "around"),
        ("guard the coin from all sides", "around"),
        ("put 8 bots round the tree", "around"),
        ("surround the trap", "around"),
        ("could you surround it?", "around"),
        ("surround it, will you?", "around"),
        ("surround the tree that stands between the yard and the bus", "around"),
        ("A dozen sentries about the fountain, please", "around"),
        ("Trap it!", "cage"),
        ("Fence the sand trap in; nothing should slip between them", "cage"),
        ("lock the jet in so it can't get out", "cage"),
        ("cordon that thing off", "cage"),
        ("Boxing in the van", "cage"),
        ("seal off the area", "cage"),
        ("surround it so nothing gets out", "cage"),
        ("so that it cannot get out, surround it", "cage"),
        ("Wall the crate in, no one may reach it", "cage"),
        ("Ring the pond with 9 guards so that visitors are kept out", "cage"),
        ("occupy the sand trap", "inside"),
        ("Fill the pool with 6 robots", "inside"),
        ("Spread 9 robots over the courtyard next to the house", "inside"),
        ("spread all over it", "inside"),
        ("Sprinkle seven bots across the lawn", "inside"),
        pytest.param("stand 3 robots on top of the sweet", "inside"),
        ("Line up 7 robots along the lower side of the roof", "along"),
        ("five drones to the left of the truck", "along"),
        ("Put 5 robots on the left side of the car", "along"),
        ("stand in a row along the north side", "along"),
        ("Place 3 robots between the car and the wall", "between"),
        ("barrier between them", "between"),
        ("Gather 3 robots at the centre of the court", "centre"),
        ("Park one robot in the very middle of the lid", "centre"),
    ],
)
def test_words_name_one_arrangement(words: str, relation: str) -> None:
    reading, question = read(words, robots=6)
    assert question is None
    assert reading.relation == relation


@pytest.mark.parametrize(
    ("words", "robots"),
    [
        ("Ring the lid with ninety-one robots", 91),
        ("Ring the lid with ninety one robots", 91),
        ("Stand a hundred and six robots around the lid", 106),
        ("Circle it with three dozen bots", 36),
        ("Circle it with 4 dozen bots", 48),
        ("Circle it with one and a half dozen bots", 18),
        ("Circle it with half a dozen bots", 6),
        ("Circle it with a baker's dozen of bots", 13),
        ("Circle it with three pairs of bots", 6),
        ("Circle it with 2,400 bots", 2400),
        ("Circle it with 2 400 bots", 2400),
        ("Circle it with 16 six-wheeled bots", 16),
        ("Circle it with 16 little green bots", 16),
        ("Circle it with 7 + 5 bots", 12),
        ("Circle it with 9", 9),
        ("9 around the tree", 9),
        ("Circle it with 9bots", 9),
    ],
)
def test_robots_are_counted_in_digits_and_words(words: str, robots: int) -> None:
    reading, question = read(words)
    assert (reading.robots, question) == (robots, None)


@pytest.mark.parametrize(
    "words",
    [
        "Surround it with minus four robots",
        "Surround it with -4 robots",
        "Surround it with 0 robots",
        "Surround it with 3.5 robots",
        "Surround it with 1,5 robots",
        "Surround it with 5 to 7 robots",
        "Surround it with five or six robots",
        "Surround it with several robots",
        "Surround it with as many robots as fit",
        "Surround it with four, no, five robots",
        "Surround it with more than 5 robots",
        "Surround it with 20 % of the robots",
        "Surround it with 10 minus 3 robots",
        "Surround it with a third of the robots",
        "Surround it with 12,000 robots",
        "Surround it with eleven thousand robots",
        "Surround it with 8 200 gram robots",
    ],
)
def test_what_is_no_count_of_robots_is_asked_about(words: str) -> None:
    reading, question = read(words)
    assert question is not None
    assert reading.robots is None or reading.robots > 10_000 or reading.unread


LENGTHS = [
    # a distance from the thing
    (", forty-five pixels away", {"clearance": [45, 46]}),
    (" at a distance of a hundred and ten px", {"clearance": [110, 111]}),
    (", half of 60 px away", {"clearance": [30, 31]}),
    (", 15 + 15 px away", {"clearance": [30, 31]}),
    (", 35 \u00b1 3 px from its edge", {"clearance": [32, 38]}),
    (", 30-45 px away", {"clearance": [30, 45]}),
    (", between 30 and 45 px away", {"clearance": [30, 45]}),
    (", three quarters of a metre away", {"clearance": [15, 16]}),
    (", two point five metres from the edge", {"clearance": [50, 51]}),
    (", point five metres away", {"clearance": [10, 11]}),
    (", 1m75 away", {"clearance": [35, 36]}),
    (", 22 dm away", {"clearance": [44, 45]}),
    (", 140cm away", {"clearance": [28, 29]}),
    (", 3 x 0.5 m away", {"clearance": [30, 31]}),
    (", no further than 14 px", {"clearance": [0, 14]}),
    (", at most 14 px away", {"clearance": [0, 14]}),
    (", at least 14 px away from it", {"clearance": [14, 100_000]}),
    (", more than 14 px away", {"clearance": [14, 100_000]}),
    (", clearance 25 px", {"clearance": [25, 26]}),
    (", keep a margin of 25 px", {"clearance": [25, 26]}),
    # from each other
    (", exactly 35 px between neighbours", {"pitch": 35}),
    (", spaced thirty px apart", {"pitch": 30}),
    (", spacing 1.5 m", {"pitch": 30}),
    (", at least 35 px apart", {"min_spacing": 35}),
    (", no two closer than 35 px", {"min_spacing": 35}),
    pytest.param(", no two robots nearer than 35 px to each other", {"min_spacing": 35}),
    (", gaps no wider than 35 px", {"max_gap": 35}),
    (", at least 35 px apart, 20 px from the thing", {"min_spacing": 35, "clearance": [20, 21]}),
    # of the ring, of an opening, of the robots
    (" on a circle of radius 80 px", {"radius": 80}),
    (", r = 80px", {"radius": 80}),
    (" in a ring of diameter 160 px", {"radius": 80}),
    (" with a 70 px doorway", {"opening": 70}),
    (", leaving an opening 70 px wide at the top", {"opening": 70, "opening_towards": "top"}),
]


@pytest.mark.parametrize(("words", "fields"), LENGTHS)
def test_a_length_belongs_to_what_it_is_said_of(words: str, fields: dict[str, Any]) -> None:
    reading, question = read(f"Surround the lid with 8 robots{words}")
    assert question is None
    assert (reading.relation, reading.robots) == ("around", 8)
    lengths = {k: v for k, v in reading.group.items() if k not in ("spacing", "fit")}
    assert lengths == {k: pytest.approx(v) for k, v in fields.items()}
    Contract.model_validate(contract_of(reading, 8, ["t1"], []))


@pytest.mark.parametrize(
    ("words", "radius"),
    [
        ("Ring it with 8 robots of radius 6 px", 6),
        ("Ring it with 8 robots, each 30 px wide", 15),
        ("Ring it with 8 robots. They are 0.6 m across.", 6),
        ("Ring it with 8 robots of diameter 12 px", 6),
    ],
)
def test_how_large_the_robots_are(words: str, radius: float) -> None:
    reading, question = read(words)
    assert question is None
    assert reading.robot_radius == pytest.approx(radius)
    assert "clearance" not in reading.group


@pytest.mark.parametrize(
    ("words", "relation", "fields"),
    [
        ("Line up 5 robots along the upper edge of it", "along", {"side": "top"}),
        ("Line 5 robots up to the right of it, 35 px away", "along", {"side": "right"}),
        ("Line up 5 robots along its longer side", "along", {"side": "long"}),
        ("Ring it tightly with 8 robots", "around", {"fit": "tight"}),
        ("Ring it with 8 robots, but not too tightly", "around", {"fit": "wide"}),
        ("8 robots around it, not too close please", "around", {"fit": "wide"}),
        ("Surround it with 8 robots, not so far away", "around", {"fit": "normal"}),
        ("Put 8 robots around it, unevenly", "around", {"spacing": "free"}),
        ("Put 8 robots around it, evenly", "around", {"spacing": "even"}),
        ("Put 8 robots around it, noses outward", "around", {"heading": "away"}),
        ("Put 8 robots around it, all of them facing it", "around", {"heading": "towards"}),
        ("Put 8 robots around it with their cameras on it", "around", {"heading": "towards"}),
        ("Put 8 robots around it, backs to it", "around", {"heading": "away"}),
        ("Put 8 robots around it, facing east", "around", {"heading": 0}),
        ("Put 8 robots around it, facing 120 degrees", "around", {"heading": 120}),
        (
            "Put 8 robots around it, but leave a gap on the right",
            "around",
            {"opening_towards": "right"},
        ),
        (
            "Put 8 robots around it, with an entrance at the bottom",
            "around",
            {"opening_towards": "bottom"},
        ),
        (
            "Put 6 robots around it, nobody on the left of it",
            "around",
            {"sides": ["right", "top", "bottom"]},
        ),
        (
            "Put 6 robots around it, none at the top",
            "around",
            {"sides": ["left", "right", "bottom"]},
        ),
        ("Put 6 robots around it, all of them south of it", "around", {"sides": ["bottom"]}),
        (
            "Surround it with 6 robots, leave the right side free",
            "around",
            {"sides": ["left", "top", "bottom"]},
        ),
        (
            "Put 7 robots in a half circle on the upper side of it",
            "around",
            {"sides": ["top half"]},
        ),
        ("Build an escape-proof cage of 9 robots around it", "cage", {"closure": "escape-proof"}),
        ("Cage it with 9 robots", "cage", {}),
        ("Cage it with 9 robots, leaving one exit", "around", {"opening": 0}),
        ("Put 4 robots between the vans as a divider", "between", {"layout": "divider"}),
    ],
)
def test_what_else_is_demanded(words: str, relation: str, fields: dict[str, Any]) -> None:
    reading, question = read(words)
    assert question is None
    assert reading.relation == relation
    assert {k: reading.group.get(k) for k in fields} == fields
    targets = ["t1", "t2"][: things_needed(reading)]
    Contract.model_validate(contract_of(reading, reading.robots or 0, targets, []))
    assert "closure" in fields or "closure" not in reading.group


@pytest.mark.parametrize(
    ("words", "kind", "robots"),
    [
        ("Draw a V with 9 robots around it", "v", 9),
        ("Put 9 robots in a V around it", "v", 9),
        ("Build a U of 9 robots around it", "u", 9),
        ("Stand in a semicircle around it, 9 of you", "arc", 9),
        ("Put 9 robots around it in a crescent", "arc", 9),
        ("Form a star around it with 10 robots", "star", 10),
        ("Make it a triangle of 9 robots around it", "polygon", 9),
    ],
)
def test_forms_are_drawn(words: str, kind: str, robots: int) -> None:
    reading, question = read(words)
    assert question is None
    assert reading.form is not None
    assert (reading.relation, reading.robots) == ("shape", robots)
    (group,) = contract_of(reading, robots, ["t1"], [])["groups"]
    assert (group["shape"]["kind"], group["shape"]["where"]) == (kind, "around")


@pytest.mark.parametrize(
    ("words", "shares"),
    [
        ("Put 4 robots on the left and 2 on the right of it", [("left", 4), ("right", 2)]),
        ("Two robots on its top side and three on its bottom side", [("top", 2), ("bottom", 3)]),
        ("Stand half of the 6 robots on the left of it, the other half on the right", None),
        ("6 robots to the left of the van and another 4 at its top", [("left", 6), ("top", 4)]),
        ("5 robots along the top of the shed, then 3 more below it", [("top", 5), ("bottom", 3)]),
        ("One robot left of the vase plus two right of the vase", [("left", 1), ("right", 2)]),
        ("8 robots on both sides of the bench, four a side", [("long", 4), ("other long", 4)]),
        ("Two robots on each short side of the rug", [("short", 2), ("other short", 2)]),
        ("Three robots on either side of the hedge", [("long", 3), ("other long", 3)]),
        ("4 robots, one on each side of it", [(s, 1) for s in ("left", "right", "top", "bottom")]),
    ],
)
def test_several_groups_have_their_numbers(
    words: str, shares: list[tuple[str, int]] | None
) -> None:
    reading, question = read(words)
    if shares is None:  # read, or asked about; never as one group
        assert question is not None or len(reading.shares) == 2
        return
    assert question is None
    assert reading.shares == shares
    groups = contract_of(reading, reading.robots or 0, ["t1"], [])["groups"]
    assert [(g["relation"], g["side"], g["robots"]) for g in groups] == [
        ("along", side, count) for side, count in shares
    ]


@pytest.mark.parametrize(
    ("words", "relation"),
    [
        ("Surround it with 10 robots, two deep", "around"),
        ("Surround it with 10 robots in two rings", "around"),
        ("Make a double row of 10 robots along it", "along"),
    ],
)
def test_two_rings_or_rows_are_two_groups(words: str, relation: str) -> None:
    reading, question = read(words)
    assert question is None
    groups = contract_of(reading, 10, ["t1"], [])["groups"]
    assert [g["relation"] for g in groups] == [relation, relation]
    assert sum(g["robots"] for g in groups) == 10
    assert groups[0] != groups[1] | {"robots": groups[0]["robots"]}


@pytest.mark.parametrize(
    ("words", "background"),
    [
        ("For the harvest fair tonight, ring the lid with 8 robots", "harvest fair"),
        ("My cousin lost a bet. Ring the lid with 8 robots, cheers", "My cousin lost a bet"),
        ("Ring the lid with 8 robots because the inspector is coming", "inspector"),
        ("Good morning, team. Ring the lid with 8 robots.", "Good morning"),
        ("Ring the lid with 8 robots like they are guarding a bank", "like they are guarding"),
        (
            "Ring the lid with 8 robots before the mayor arrives at four",
            "the mayor arrives at four",
        ),
        ("We close early tonight. Ring the lid with 8 robots.", "tonight"),
        ("Keep visitors away from the lid: 8 robots round it", "Keep visitors away"),
    ],
)
def test_background_changes_nothing_and_is_repeated(words: str, background: str) -> None:
    reading, question = read(words)
    assert question is None
    assert (reading.relation, reading.robots, reading.group) == ("around", 8, {})
    assert any(background in quote for quote in reading.background)


KINDS = {
    "side": "along",
    "cage": "cage",
    "center": "centre",
    "line_between": "between",
    "boundary": "around",
}
SPLITS = [
    *((name, "dev") for name in ("photos", "scenes", "many", "frontier")),
    *(("formation-dev", split) for split in ("train", "dev", "test")),
]


@pytest.mark.parametrize(("suite", "split"), SPLITS)
def test_instructions_of_the_suites_are_read_as_their_rules_mean_them(
    suite: str, split: str
) -> None:
    """Asked about, or read as the arrangement and the number that are graded."""
    wrong: list[str] = []
    for task in load_suite(suite, split).tasks:
        reading = read_instruction(task.instruction, task.metres_per_pixel)
        targets = ("t1", "t2")[: things_needed(reading)]
        fixed = Task(task.instruction, task.robots, (), targets, True, task.metres_per_pixel)
        if question_of(fixed, reading, task.robots) is not None:
            continue
        rule = task.goals[0].success
        where = str(rule["where"]).partition(":")[0]
        meant = "cage" if rule.get("closed") else KINDS.get(where, where)
        if reading.relation != meant or reading.robots not in (None, task.robots):
            wrong.append(f"{task.instruction} {reading.relation} {reading.robots}")
    assert wrong == []


@pytest.mark.parametrize(
    "words",
    [
        "Line the inside of the pale patch with 11 robots",
        "Ring the inside of the court with 8 robots",
        "Surround the inside edge of the pool with 6 robots",
        "Guard the interior of the fence with 4 robots",
    ],
)
def test_the_inside_of_a_thing_is_not_its_surroundings(words: str) -> None:
    reading, question = read(words)
    assert reading.unread
    assert question is not None


def test_the_inside_of_a_thing_is_filled_where_the_command_says_so() -> None:
    reading, question = read("Fill the inside of the box with 6 robots")
    assert (reading.relation, question) == ("inside", None)
