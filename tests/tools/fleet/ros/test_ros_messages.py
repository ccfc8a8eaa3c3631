"""What is believed of messages of ROS, and what velocities are made of them."""

import math
from typing import Any

import pytest
from formup.tools.fleet.ros.messages import goal_of, hold_of, pose_message, stamped, twist
from formup.tools.fleet.ros.settings import RosSettings
from formup.tools.fleet.ros.tracking import velocity
from formup.tools.fleet.wire.frame import RobotFrame
from formup.tools.fleet.wire.poses import MOST_REASONS, PoseMessage, Poses
from hypothesis import given
from hypothesis import strategies as st

SETTINGS = RosSettings(
    bridge="ws://h", robots=("a",), speed=1, radius=1, tracking_error=1, frame=RobotFrame()
)


def report(**more: Any) -> dict[str, Any]:
    made = stamped("map", (1.5, -2.0), math.pi / 2)
    made["header"]["stamp"] = {"sec": 3, "nanosec": 7}
    return made | more


def test_a_pose_is_read_from_both_kinds_of_messages() -> None:
    wanted = pose_message(report(), SETTINGS)
    assert isinstance(wanted, PoseMessage)
    assert (wanted.seq, wanted.x, wanted.y) == (3_000_000_007, 1.5, -2.0)
    assert wanted.heading == pytest.approx(math.pi / 2)
    odometry = report(pose={"pose": report()["pose"], "covariance": [0.0] * 36}, twist={})
    assert pose_message(odometry, SETTINGS) == wanted
    in_ros_1 = report(header=report()["header"] | {"frame_id": "/map"})
    assert pose_message(in_ros_1, SETTINGS) == wanted
    told = pose_message(report(), SETTINGS, "broken")
    assert isinstance(told, PoseMessage) and told.fault == "broken"


PLACE, TURNED = report()["pose"]["position"], report()["pose"]["orientation"]


@pytest.mark.parametrize(
    ("more", "why"),
    [
        (
            {"header": {"frame_id": "odom", "stamp": {"sec": 1, "nanosec": 0}}},
            "in the frame 'odom'",
        ),
        ({"header": {"frame_id": "map", "stamp": {"sec": "a", "nanosec": 0}}}, "malformed"),
        ({"header": {"frame_id": "map", "stamp": {"sec": -1, "nanosec": 0}}}, "malformed"),
        ({"header": {"frame_id": "map"}}, "malformed"),
        ({"pose": None}, "malformed"),
        ({"pose": {"position": PLACE | {"x": None}, "orientation": TURNED}}, "malformed"),
        ({"pose": {"position": PLACE | {"x": math.nan}, "orientation": TURNED}}, "malformed"),
        ({"pose": {"position": PLACE | {"x": 1e9}, "orientation": TURNED}}, "malformed"),
        ({"pose": {"position": PLACE | {"x": "1"}, "orientation": TURNED}}, "malformed"),
        ({"pose": {"position": PLACE, "orientation": TURNED | {"w": 9.0}}}, "malformed"),
        ({"pose": {"position": PLACE}}, "malformed"),
    ],
)
def test_what_is_not_believed_is_told_why(more: dict[str, Any], why: str) -> None:
    told = pose_message(report(**more), SETTINGS)
    assert isinstance(told, str) and told.startswith(why)


@pytest.mark.parametrize("message", [None, [], "pose", 3, {}])
def test_what_is_no_message_at_all_is_malformed(message: object) -> None:
    assert pose_message(message, SETTINGS) == "malformed"
    assert goal_of(message) is None
    assert hold_of(message) == ""


def test_a_robot_that_names_ever_other_frames_fills_no_memory() -> None:
    poses = Poses(SETTINGS)
    for i in range(1000):
        header = {"frame_id": f"f{i}", "stamp": {"sec": 1, "nanosec": 0}}
        poses.heard("a", pose_message(report(header=header), SETTINGS), 1.0)
    track = poses.tracks["a"]
    assert len(track.refused) <= MOST_REASONS + 1
    assert sum(track.refused.values()) == 1000


def test_goals_and_velocities_are_read_as_they_are_said() -> None:
    assert goal_of(stamped("map", (1.25, 2.5))) == (1.25, 2.5)
    assert goal_of(twist((0.5, -1.0))) == (0.5, -1.0)
    assert goal_of({"linear": {"x": math.inf}, "angular": {"z": 0}}) is None


@given(
    x=st.floats(-5, 5),
    y=st.floats(-5, 5),
    heading=st.floats(-7, 7),
    speed=st.floats(0.05, 2),
    turn=st.floats(0.3, 3),
)
def test_a_robot_comes_to_the_point_within_its_limits_without_a_detour(
    x: float, y: float, heading: float, speed: float, turn: float
) -> None:
    place, far = (x, y), math.hypot(x, y)
    for _ in range(20_000):
        ahead, about = velocity(place, heading, (0.0, 0.0), (speed, turn), 0.01)
        assert 0 <= ahead <= speed
        assert abs(about) <= turn
        if (ahead, about) == (0, 0):
            break
        heading += about * 0.05
        place = (
            place[0] + ahead * 0.05 * math.cos(heading),
            place[1] + ahead * 0.05 * math.sin(heading),
        )
        assert math.hypot(*place) <= far + 1e-9
        far = math.hypot(*place)
    assert far <= 0.01
