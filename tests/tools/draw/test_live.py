"""What is told of robots while they drive."""

import numpy as np
import pytest
from formup.tools.draw.canvas import Colour
from formup.tools.draw.live import BAD, GOOD, PANEL, Course, Ground
from formup.tools.fleet.pace import Pace
from formup.tools.fleet.protocol import Pose
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import make_plan
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.image import picture_from_array
from formup.tools.world import Target, World

PICTURE = picture_from_array(np.full((200, 300, 3), 230, dtype=np.uint8))
OUTLINE = make_outline([(120, 60), (180, 60), (180, 120), (120, 120)])
TARGET = Target(
    id="t1", label="box", box=OUTLINE.bounds, confidence=1, outline=OUTLINE, prompt="box"
)
WORLD = World.of(PICTURE).with_target(TARGET)
CONTRACT = Contract(groups=(Group(relation="around", targets=("t1",), robots=2),))
PLACES = [(90.0, 90.0), (210.0, 90.0)]
PLAN = make_plan(CONTRACT, WORLD.site(CONTRACT), WORLD.version_of(CONTRACT), PLACES)


def seen(*points: tuple[float, float], at: float = 0.0) -> tuple[Pose, ...]:
    return tuple(Pose(str(i), x, y, None, at) for i, (x, y) in enumerate(points, start=1))


def figures(course: Course, scale: float | None = None) -> dict[str, tuple[str, Colour]]:
    rows = course.figures(Pace(1.0), scale, 20)
    return {name: (value, colour) for name, value, colour in rows}


def test_the_least_separation_is_that_of_the_whole_drive() -> None:
    course = Course(PLAN, (300, 200), 4.0)
    course.see(seen((90, 190), (97, 190), (10, 10), at=3.0))
    course.see(seen((90, 110), (210, 90), (10, 10), at=4.5))
    told = figures(course)
    assert told["time"][0] == "1.50 s"
    assert told["least so far"] == ("7.0 px", BAD)
    assert told["demanded"][0] == "8.0 px"
    assert told["now"][0] == f"{np.hypot(120, 20):.1f} px"
    assert told["arrived"][0] == "1 of 2"
    assert told["robot 1"][0] == told["furthest"][0] == "20.0 px"
    assert told["robot 2"] == ("0.0 px", GOOD)
    assert "robot 3" not in told, "it has no place"


def test_a_robot_alone_is_near_no_other_and_points_demand_nothing() -> None:
    course = Course(PLAN, (300, 200), 0.0)
    course.see(seen((90, 190)))
    told = figures(course)
    assert told["now"][0] == told["least so far"][0] == told["demanded"][0] == "none"


def test_lengths_are_metres_where_the_scale_is_known_and_rows_are_counted() -> None:
    course = Course(PLAN, (300, 200), 4.0)
    course.see(seen((90, 190), (210, 90)))
    assert figures(course, scale=0.1)["furthest"][0] == "10.00 m (100.0 px)"
    few = course.figures(None, None, 8)
    assert [row[0] for row in few][-1] == "and 2 nearer ones"
    both = course.figures(None, None, 10)
    assert [row[0] for row in both][-2:] == ["robot 1", "robot 2"]


@pytest.mark.parametrize(
    ("ended", "held", "paused", "state"),
    [
        (False, False, False, "driving"),
        (False, False, True, "paused"),
        (False, True, False, "held"),
        (True, False, False, "not all arrived"),
    ],
)
def test_the_state_is_told(ended: bool, held: bool, paused: bool, state: str) -> None:
    course = Course(PLAN, (300, 200), 4.0)
    course.see(seen((90, 190), (210, 90)))
    course.ended = ended
    assert course.state(Pace(1.0, paused), held=held)[0] == state
    course.see(seen((90, 90), (210, 90)))
    course.ended = True
    assert course.state(None, held=False)[0] == "all arrived"


@pytest.mark.parametrize("size", [(1230, 760), (700, 900), (PANEL + 2, 43)])
def test_what_is_enlarged_stays_in_the_picture_and_comes_back(size: tuple[int, int]) -> None:
    ground = Ground(PICTURE, WORLD, PLAN, "Two", 4.0)
    whole = ground.draw(size)
    assert whole.size == size
    ground.zoom(4.0, (0.0, 40.0))
    ground.pan((-1e6, 1e6))
    ground.draw(size)
    edge = ground.canvas.at(np.array([[299.0, 0.0]]))[0]
    box = np.array(ground.canvas.photo)
    assert np.abs(edge - box[[2, 1]]).max() <= 2 * ground.canvas.scale.max() + 1
    ground.zoom(0.0)
    assert ground.draw(size).tobytes() == whole.tobytes()
