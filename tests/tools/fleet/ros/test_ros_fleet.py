"""Robots behind a bridge are a fleet like any other, whatever they are driven by."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from deploying import SURE, check_headings
from formup.tools.fleet.conformance import check_fleet

Labs = Callable[..., Any]


MODES = ["pose", "cmd_vel", "nav2"]


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("by", MODES)
def test_it_passes_what_every_fleet_has_to(lab: Labs, by: str, turns: bool) -> None:
    there = lab(drive_by=by, turns=turns).simulate()
    asyncio.run(check_fleet(there.fleet))


@pytest.mark.parametrize("by", MODES)
def test_robots_look_where_a_plan_says(lab: Labs, by: str) -> None:
    check_headings(lab(**SURE, drive_by=by, turns=True).simulate())


def test_it_may_speak_odometry_and_metres_and_names_of_its_own(lab: Labs) -> None:
    there = lab(
        pose_type="nav_msgs/Odometry",
        turns=True,
        frame_id="odom",
        frame={"metres_per_pixel": 0.01, "origin": [0, 480], "turn": 10},
        speed=1.0,
        radius=0.05,
        tracking_error=0.02,
        topics={"pose": "/r_{robot}/odom", "goal": "/r_{robot}/go", "hold": "/hold"},
        simulated={"starts": [[0.5, 2], [0.5, 2.5], [0.5, 3]]},
    ).simulate()
    asyncio.run(check_fleet(there.fleet))
