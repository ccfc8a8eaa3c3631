"""What counts as another thing in the picture, and what is said of robots that meet one."""

import numpy as np
import pytest
import shapely
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.encounters import (
    MOST_NOTES,
    Encounter,
    encounters_of,
    notes_of,
    others_than,
)
from formup.tools.formation.plan import make_plan
from formup.tools.formation.site import Other, Site
from formup.tools.geometry.outline import Outline, make_outline, outline_of
from shapely.geometry.base import BaseGeometry

TARGET = outline_of(shapely.box(200, 150, 300, 250))


def thing(region: BaseGeometry, name: str = "c1", confidence: float = 1.0) -> Other:
    return Other(name, "red oval", outline_of(region).polygon, confidence)


def others(*things: Other, entered: bool = False, target: Outline = TARGET) -> list[str]:
    group = Group(relation="inside" if entered else "around", targets=("t1",), robots=2)
    return [t.id for t in others_than(Contract(groups=(group,)), {"t1": target}, things)]


@pytest.mark.parametrize(
    ("region", "kept"),
    [
        (shapely.box(400, 150, 450, 250), True),
        (shapely.box(295, 150, 400, 250), True),  # outlines are not exact
        (shapely.box(201, 149, 299, 252), False),  # the target itself
        (shapely.box(220, 170, 240, 190), False),  # a part of it
        (shapely.box(100, 50, 500, 350), False),  # what it lies on
    ],
)
def test_targets_their_parts_and_their_ground_are_no_other_things(
    region: BaseGeometry, kept: bool
) -> None:
    assert bool(others(thing(region))) is kept


def test_what_lies_in_the_hole_of_a_target_belongs_to_it() -> None:
    frame = outline_of(shapely.box(200, 150, 300, 250) - shapely.box(210, 160, 290, 240))
    assert others(thing(shapely.box(230, 180, 260, 210)), target=frame) == []


def test_what_has_a_hole_with_room_for_the_target_is_another_thing_with_that_hole_alone() -> None:
    middle, second = shapely.box(180, 130, 320, 270), shapely.box(340, 180, 370, 210)
    handle = thing(shapely.box(150, 100, 400, 300) - middle - second)
    group = Group(relation="around", targets=("t1",), robots=2)
    kept = others_than(Contract(groups=(group,)), {"t1": TARGET}, [handle])
    assert [len(thing.region.interiors) for thing in kept] == [1]
    assert not kept[0].region.intersects(TARGET.polygon)
    assert kept[0].region.contains(second)


def test_what_shows_nothing_round_the_target_but_a_rim_is_what_it_lies_on() -> None:
    rim = shapely.box(195, 145, 305, 255)
    assert others(thing(shapely.box(100, 50, 500, 350) - rim)) == []


def test_on_a_target_that_robots_enter_only_what_is_sure_and_small_stands() -> None:
    small, large = shapely.box(220, 170, 240, 190), shapely.box(201, 151, 299, 249)
    assert others(thing(small), entered=True) == ["c1"]
    assert others(thing(small, confidence=0.5), entered=True) == []
    assert others(thing(large), entered=True) == []


def test_what_is_found_twice_is_one_thing() -> None:
    first, again = shapely.box(310, 150, 400, 250), shapely.box(320, 155, 395, 245)
    assert others(thing(first), thing(again, "c2")) == ["c1"]


def test_every_robot_on_over_or_cut_off_is_named_with_the_thing() -> None:
    outline = make_outline([(0, 150), (100, 150), (100, 250), (0, 250)])
    found = (
        thing(shapely.box(190, 40, 220, 60), "c1"),
        thing(shapely.box(300, 40, 320, 400), "c2", 0.45),
        thing(shapely.box(500, 400, 520, 420), "c3"),
    )
    site = Site({"t1": outline}, 640, 480, others=found)
    free = Group(relation="shape", robots=3)
    plan = make_plan(
        Contract(groups=(free,)), site, "s", [(200.0, 50.0), (400.0, 300.0), (639.0, 100.0)]
    )
    starts = np.array([(50.0, 50.0), (250.0, 300.0), (600.0, 100.0)])
    ways = np.stack([starts, plan.formation.points], axis=1)
    met = encounters_of(plan, site, dict(zip("123", ways, strict=True)), 0.0)
    assert [(e.how, e.robots, e.thing) for e in met] == [
        ("on", ("1",), "c1"),
        ("over", ("2",), "c2"),
        ("border", ("3",), ""),
    ]
    said = notes_of(met)
    assert said[0].startswith("Robot 1 stands on or right beside c1 (red oval)")
    assert "drives over c2" in said[1]
    assert "too faint to tell" in said[1]
    assert "border" in said[2]


def test_who_leaves_the_picture_on_the_way_is_named_and_who_only_comes_into_it_is_not() -> None:
    site, free = Site({}, 640, 480), Group(relation="shape", robots=3)
    places = [(400.0, 300.0), (500.0, 300.0), (600.0, 300.0)]
    plan = make_plan(Contract(groups=(free,)), site, "s", places)
    ways = {
        "1": np.array([(50.0, 50), (200, 2), places[0]]),
        "2": np.array([(50.0, 90), (200, 7), places[1]]),
        "3": np.array([(50.0, -30), places[2]]),
    }
    assert [(e.how, e.robots) for e in encounters_of(plan, site, ways, 5.0)] == [("beyond", ("1",))]
    (said,) = notes_of(encounters_of(plan, site, ways, 5.0))
    assert said.startswith("Robot 1 leaves the picture on the way")


def test_more_than_anybody_reads_are_counted() -> None:
    many = [Encounter(how="on", robots=("1", "2"), thing=f"c{k}", label="x") for k in range(12)]
    assert len(notes_of(many)) == MOST_NOTES + 1
    assert "4 more" in notes_of(many)[-1]
