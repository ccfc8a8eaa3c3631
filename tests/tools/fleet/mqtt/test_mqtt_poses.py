"""What is believed of what robots say: in order, within reach, by our own clock."""

import json
import math
from collections.abc import Iterable
from typing import Any

import pytest
from formup.tools.fleet.mqtt.messages import MOST_BYTES, pose_message
from formup.tools.fleet.mqtt.settings import MqttSettings
from formup.tools.fleet.wire.poses import PoseMessage, Poses

SETTINGS = MqttSettings(
    broker="mqtt://h", robots=("a",), speed=100, radius=5, tracking_error=2, pose_timeout=0.5
)


def heard(*messages: tuple[float, dict[str, Any] | bytes], robot: str = "a") -> Poses:
    poses = Poses(SETTINGS)
    for now, message in messages:
        said = message if isinstance(message, bytes) else json.dumps(message).encode()
        poses.heard(robot, pose_message(said), now)
    return poses


def at(now: float, seq: int, x: float, **more: Any) -> tuple[float, dict[str, Any]]:
    return now, {"seq": seq, "x": x, "y": 0.0, **more}


def where(poses: Poses) -> Iterable[float]:
    return [pose.x for pose in poses.seen()]


def test_the_second_in_order_is_believed() -> None:
    assert where(heard(at(1, 1, 10))) == []
    poses = heard(at(1, 1, 10), at(1.1, 2, 12, heading=0.5))
    (pose,) = poses.seen()
    assert (pose.x, pose.heading, pose.seen) == (12, 0.5, 1.1)
    assert poses.age("a", 1.3) == pytest.approx(0.2)
    assert poses.old(1.3, 0.5) == {}
    assert list(poses.old(1.7, 0.5)) == ["a"]


@pytest.mark.parametrize(
    ("message", "why"),
    [
        ({"seq": 2, "x": 13, "y": 0}, "out of order"),
        ({"seq": 1, "x": 13, "y": 0}, "out of order"),
        ({"seq": 3, "x": 200, "y": 0}, "jumped"),
        ({"seq": 3, "x": math.nan, "y": 0}, "malformed"),
        ({"seq": 3, "x": math.inf, "y": 0}, "malformed"),
        ({"seq": 3, "x": 1e300, "y": 0}, "malformed"),
        ({"seq": 3, "x": "13", "y": 0}, "malformed"),
        ({"seq": 3.5, "x": 13, "y": 0}, "malformed"),
        ({"seq": True, "x": 13, "y": 0}, "malformed"),
        ({"x": 13, "y": 0}, "malformed"),
        ({"seq": 3, "x": 13, "y": 0, "heading": "north"}, "malformed"),
        ({"seq": 3, "x": 13, "y": 0, "more": "x" * MOST_BYTES}, "malformed"),
        ([], "malformed"),
        (b"\xff\x00", "malformed"),
        (b"", "malformed"),
        (b"[" * 4000, "malformed"),
    ],
)
def test_what_is_not_believed_changes_nothing_but_is_counted(message: Any, why: str) -> None:
    poses = heard(at(1, 1, 10), at(1.1, 2, 12), (1.2, message))
    (pose,) = poses.seen()
    assert (pose.x, pose.seen) == (12, 1.1)
    track = poses.tracks["a"]
    assert (track.why, track.refused, track.heard) == (why, {why: 1}, 3)
    poses.heard("a", PoseMessage(seq=4, x=13, y=0), 1.25)
    assert where(poses) == [13]


def test_a_robot_that_was_carried_is_believed_where_it_is_once_it_was_lost() -> None:
    away = [at(1.2 + 0.1 * i, 3 + i, 900) for i in range(10)]
    poses = heard(at(1, 1, 10), at(1.1, 2, 12), *away[:5])
    assert where(poses) == [12]
    assert "in two places" in poses.old(1.65, 0.5)["a"]
    poses = heard(at(1, 1, 10), at(1.1, 2, 12), *away)
    assert where(poses) == [900]
    assert poses.old(2.2, 0.5) == {}


def test_two_robots_of_one_id_are_not_believed_however_often_they_speak() -> None:
    both = [at(1 + 0.05 * i, i, 900 * (i % 2)) for i in range(40)]
    assert "do two robots use its id?" in heard(*both).old(3.0, 0.5)["a"]


def test_messages_of_nobody_are_kept_apart() -> None:
    poses = heard(at(1, 1, 10), at(1.1, 2, 12), robot="z")
    assert (poses.unknown, where(poses)) == ({"z"}, [])
    for i in range(100):
        poses.heard(str(i), None, 1.0)
    assert len(poses.unknown) < 30


def test_what_is_forgotten_is_seen_anew() -> None:
    poses = heard(at(1, 1, 10), at(1.1, 2, 12))
    poses.forget()
    assert where(poses) == []
    assert poses.old(1.2, 0.5) == {"a": "Robot a not seen yet."}
