"""Robots that run ROS 2 and that a camera sees: it says where they are, and they need not know."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from drawn import MORE, SEEN, Drawn, deployed
from formup.tools.errors import InputError
from formup.tools.fleet.protocol import FleetRequest
from formup.tools.fleet.ros.checkup import checked
from formup.tools.fleet.ros.fleet import open_fleet

Labs = Callable[..., Any]


def silent(message: dict[str, Any], n: int) -> None:
    """Nothing is said."""


@pytest.mark.parametrize("by", ["pose", "cmd_vel", "nav2"])
def test_robots_arrive_by_what_the_camera_sees_and_say_nothing(
    lab: Labs, drawn: Drawn, by: str
) -> None:
    there = drawn.lab = lab(**MORE, frame=None, drive_by=by).simulate()
    there.robots.faults.update(dict.fromkeys("abc", silent))
    arrival, planned = deployed(there)
    assert arrival.arrived, arrival
    off = there.robots.points[:, None] - planned.formation.points[None]
    assert np.linalg.norm(off, axis=2).min(axis=1).max() * SEEN.metres_per_pixel < 0.01


def test_a_goal_that_nav2_gives_up_is_named_though_the_robot_is_seen(
    lab: Labs, drawn: Drawn
) -> None:
    there = drawn.lab = lab(**MORE, frame=None, drive_by="nav2").simulate()
    arrival, _ = deployed(there, lambda: there.robots.result(6))
    assert (arrival.ended, len(arrival.failed)) == ("failed", 1)
    assert "Nav2 gave up its goal, status 6" in (arrival.reason or "")


def test_the_check_sees_robots_by_their_tags(lab: Labs, drawn: Drawn) -> None:
    there = drawn.lab = lab(**MORE, frame=None).simulate()
    there.robots.faults.update(a=silent)
    drawn.covered.add("b")
    told, fit = checked(there.settings, 1.5)
    assert (fit, told[-1]) == (False, "2 of 3 robots can be driven."), told


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"camera": MORE["camera"] | {"tags": {"a": 4, "b": 7}}}, "camera.tags takes every robot"),
        ({"frame": {"y": "down"}}, "frame is that of the camera's calibration"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    lab: Labs, drawn: Drawn, more: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        lab(**{**MORE, "frame": None, **more})


def test_a_picture_that_the_camera_has_not_seen_from_above_is_refused(
    lab: Labs, drawn: Drawn
) -> None:
    made = lab(**MORE, frame=None)
    with pytest.raises(InputError, match="720 x 520"):
        open_fleet(FleetRequest((640, 480), 3, config=made.path))
