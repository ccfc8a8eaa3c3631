"""What leaves for programs that drive robots themselves: velocities keep robots on their paths."""

import csv
import io
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from formup.tools.errors import FleetError
from formup.tools.fleet.simulator import PERIOD, tracking_error
from formup.tools.fleet.trajectories import Trajectories, tracked, wheeled
from formup.tools.geometry.outline import FloatArray
from formup.tools.motion.checking import MotionVerdict
from formup.tools.motion.motion import Motion, Passages, arc_lengths
from hypothesis import given, settings
from hypothesis import strategies as st

CERTIFIED = MotionVerdict(certified=True)
CROSSING = {"a": np.array([[0.0, 0], [100, 0]]), "b": np.array([[50.0, -50], [50, 50]])}
ORDER = Passages(np.array([1]), np.array([40.0]), np.array([0]), np.array([60.0]))
ROBOTS = wheeled(speed=80, acceleration=320, radius=5)


def followed(motion: Motion, verdict: MotionVerdict = CERTIFIED) -> Trajectories:
    return tracked(motion, verdict, ROBOTS, {"b": 1.0}, tracking_error(ROBOTS))


@pytest.fixture
def crossing() -> Motion:
    """Robot b passes the way of a once a has."""
    times = {robot: arc_lengths(path) / ROBOTS.speed for robot, path in CROSSING.items()}
    return Motion(CROSSING, {"a": 1.5}, times, ORDER)


def unicycle(pose: FloatArray, commands: FloatArray) -> FloatArray:
    """Poses, (k, 3), of a unicycle from one on, along exact arcs."""
    poses = [pose]
    for speed, turn in commands[:-1]:
        x, y, way = poses[-1]
        angle, chord = turn * PERIOD / 2, speed * PERIOD
        chord *= math.sin(angle) / angle if angle else 1.0
        step = chord * np.array([math.cos(way + angle), math.sin(way + angle)])
        poses.append(np.array([x + step[0], y + step[1], way + 2 * angle]))
    return np.array(poses)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(10, 400), st.floats(1, 12), st.floats(1, 25))
def test_velocities_keep_a_unicycle_within_the_bound_of_the_path(
    seed: int, speed: float, seconds: float, radius: float
) -> None:
    rng, robots = np.random.default_rng(seed), wheeled(speed, speed * seconds, radius)
    legs = rng.uniform(-60, 60, (int(rng.integers(1, 6)), 2))
    bends = np.linspace(0, rng.uniform(-3, 3), 16)
    round_ = 3 * np.stack([np.cos(bends), np.sin(bends)], axis=1)
    path = np.cumsum(np.concatenate([rng.uniform(0, 500, (1, 2)), legs, round_]), axis=0)
    motion = Motion({"r": path}, times={"r": arc_lengths(path) / speed})
    error = tracking_error(robots)
    made = tracked(motion, CERTIFIED, robots, {"r": float(rng.uniform(-3, 3))}, error)
    poses = unicycle(made.poses[0, 0], made.commands[:, 0])
    off = shapely.distance(shapely.LineString(path), shapely.points(poses[:, :2]))
    assert off.max() <= error
    assert poses[-1, :2] == pytest.approx(path[-1], abs=error)
    assert poses == pytest.approx(made.poses[:, 0], abs=0.02)
    wheels = abs(made.commands[:, 0, 0]) + radius * abs(made.commands[:, 0, 1])
    assert wheels.max() <= speed * (1 + 1e-9)
    changes = np.diff(made.commands[:, 0] * [1, radius], axis=0)
    assert np.abs(changes[:-1]).sum(axis=1).max() <= speed * seconds * PERIOD * (1 + 1e-9)


def test_robots_keep_their_order_and_look_where_they_are_to_at_the_end(crossing: Motion) -> None:
    made = followed(crossing)
    apart = np.linalg.norm(made.poses[:, 0, :2] - made.poses[:, 1, :2], axis=1)
    waits = made.along[:, 0] < 60
    assert made.along[waits, 1].max() <= 40 + tracking_error(ROBOTS)
    assert apart.min() > 2 * ROBOTS.radius
    assert made.poses[0, :, 2].tolist() == [0.0, 1.0]
    assert made.poses[-1, 0, 2] == pytest.approx(1.5, abs=0.01)
    assert not made.commands[-1].any()


def test_data_are_in_pixels_and_where_a_picture_has_a_scale_in_metres(crossing: Motion) -> None:
    made = followed(crossing)
    data = made.data(0.02)
    assert data["passages"] == [{"robot": "b", "at_px": 40.0, "first": "a", "past_px": 60.0}]
    assert data["error_px"] == pytest.approx(tracking_error(ROBOTS))
    mine = data["robots"]["b"]
    assert mine["waypoints_px"][-1] == [1.25, 50.0, 50.0]
    assert mine["waypoints_m"][-1] == [1.25, 1.0, 1.0]
    assert "poses_m" not in made.data(None)["robots"]["b"]
    rows = list(csv.DictReader(io.StringIO(made.table(0.02))))
    assert len(rows) == 2 * len(made.poses)
    assert [row["waits_for"] for row in rows if row["waits_for"]] == ["a@60.000000"]
    (held,) = [row for row in rows if row["waits_for"]]
    assert held["robot"] == "b"
    assert float(held["along_px"]) <= 40
    assert float(held["x_m"]) == pytest.approx(0.02 * float(held["x_px"]), abs=1e-6)
    assert "x_m" not in made.table(None)


def test_what_comes_nearer_than_is_allowed_does_not_leave(crossing: Motion) -> None:
    loose = replace(crossing, passages=Passages())
    with pytest.raises(FleetError, match="would come within"):
        followed(loose, CERTIFIED.model_copy(update={"demanded_px": 30.0}))
