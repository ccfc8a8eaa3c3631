"""Motions keep robots apart, whoever is late, and their certificates say so from them alone."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from formup.tools.formation.site import Site
from formup.tools.geometry.outline import FloatArray
from formup.tools.geometry.sampling import min_spacing
from formup.tools.motion.checking import check_motion
from formup.tools.motion.following import Following
from formup.tools.motion.motion import Motion, Passages, arc_lengths
from formup.tools.motion.planning import (
    Ground,
    NoOrderError,
    Team,
    assigned,
    plan_motion,
    separation,
)
from hypothesis import given, settings
from hypothesis import strategies as st

RADIUS, SPEED = 3.0, 100.0
SITE = Site({}, 640, 480)
BOX = {"t1": shapely.box(250, 180, 400, 300)}
SEEDS = st.integers(0, 2**32 - 1)


def scattered(rng: np.random.Generator, n: int, apart: float) -> FloatArray:
    """Points off the box, no two of them nearer than that."""
    kept: list[FloatArray] = []
    for point in rng.uniform((10, 10), (630, 470), (4000, 2)):
        off = BOX["t1"].distance(shapely.Point(point))
        if off > 2 * RADIUS and all(np.hypot(*(point - other)) > apart for other in kept):
            kept.append(point)
        if len(kept) == n:
            break
    return np.array(kept)


def team(starts: FloatArray, **more: object) -> Team:
    ids = tuple(f"r{i}" for i in range(len(starts)))
    return replace(Team(ids, starts, RADIUS, SPEED), **more)


def planned(starts: FloatArray, goals: FloatArray, *, interchangeable: bool = True) -> Motion:
    motion, robots, verdict = plan_motion(
        team(starts), goals, Ground(BOX, SITE), interchangeable=interchangeable
    )
    assert verdict.certified, verdict.findings
    assert list(motion.paths) == list(robots)
    for robot, goal in zip(robots, goals, strict=True):
        path, times = motion.paths[robot], motion.times[robot]
        assert np.allclose(path[0], starts[int(robot[1:])])
        assert np.allclose(path[-1], goal)
        legs = np.linalg.norm(np.diff(path, axis=0), axis=1)
        assert (legs <= SPEED * np.diff(times) + 1e-6).all(), "nobody is faster than it can be"
    return motion


def closest_of_late(motion: Motion, rng: np.random.Generator, stopped: int | None) -> float:
    """The closest approach where every robot goes on by a random share of its speed each step.

    Between steps robots move straight on, as their paths bend a little there at most.
    """
    following, n = Following(motion), len(motion.paths)
    progress, closest = np.zeros(n), np.inf
    last = following.at(progress)
    for _ in range(4000):
        wanted = progress + rng.random(n) * SPEED * 0.02
        if stopped is not None:
            wanted[stopped] = min(wanted[stopped], 0.3 * following.lengths[stopped])
        progress = np.maximum(np.minimum(wanted, following.limits(progress)), progress)
        now = following.at(progress)
        middle = following.at(progress)
        closest = min(closest, min_spacing(now), min_spacing((last + middle) / 2))
        if (progress >= following.lengths - 1e-6).all():
            return closest
        last = now
    waiting = following.waits_for(progress, 1e-3)
    for i in np.flatnonzero(progress < following.lengths - 1e-6):
        assert i == stopped or following.ids[i] in waiting, (
            "who has not arrived waits, and is named"
        )
    assert stopped is not None, "without a robot that has stopped all arrive"
    return closest


@settings(max_examples=30, deadline=None)
@given(SEEDS, st.integers(1, 25), st.booleans())
def test_nobody_is_touched_however_late_anybody_is(seed: int, n: int, stops: bool) -> None:
    rng = np.random.default_rng(seed)
    starts, goals = scattered(rng, n, 2.2 * RADIUS), scattered(rng, n, 2.2 * RADIUS)
    ground = Ground(BOX, SITE)
    motion = planned(starts[assigned(starts, goals, ground, RADIUS)], goals)
    stopped = int(rng.integers(n)) if stops else None
    closest = closest_of_late(motion, rng, stopped)
    assert closest >= separation(starts, goals, RADIUS) - 1e-6


@pytest.mark.parametrize("n", [4, 16, 49])
def test_a_packed_block_moves_into_a_packed_block(n: int) -> None:
    side = int(np.sqrt(n))
    block = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    starts = np.asarray(20 + 2.1 * RADIUS * block, dtype=float)
    goals = starts + np.array([480.0, 180.0])
    motion = planned(starts, goals)
    longest = max(float(arc_lengths(path)[-1]) for path in motion.paths.values())
    assert motion.makespan < 2 * longest / SPEED


def test_robots_on_each_others_places_exchange_them_or_stay() -> None:
    starts = np.array([[100.0, 100], [200, 100]])
    motion = planned(starts, starts[::-1])
    assert motion.makespan == 0, "interchangeable robots are there already"
    labelled = planned(starts, starts[::-1], interchangeable=False)
    assert labelled.makespan * SPEED > 100, "the others go around each other"


def test_robots_that_cannot_let_each_other_pass_are_named() -> None:
    walls = {"k1": shapely.box(-50, 106, 700, 140), "k2": shapely.box(-50, 60, 700, 94)}
    starts = np.array([[100.0, 100], [200, 100]])
    with pytest.raises(NoOrderError, match="Robots r0, r1 stand in each other's way") as caught:
        plan_motion(team(starts), starts[::-1], Ground(walls, SITE), interchangeable=False)
    assert caught.value.ids == ("r0", "r1")


def test_idle_robots_are_not_touched() -> None:
    idle = {"x": (200.0, 100.0), "y": (200.0, 112.0)}
    starts, goals = np.array([[100.0, 105]]), np.array([[300.0, 105]])
    motion, _, verdict = plan_motion(
        team(starts, idle=idle), goals, Ground(BOX, SITE), interchangeable=True
    )
    assert verdict.certified
    assert verdict.separation_px is not None
    assert verdict.separation_px >= 2 * RADIUS
    assert arc_lengths(motion.paths["r0"])[-1] > 200


STRAIGHT = Motion(
    paths={"a": np.array([[0.0, 0], [100, 0]]), "b": np.array([[50.0, -50], [50, 50]])},
    times={"a": np.array([0.0, 1]), "b": np.array([0.0, 1])},
)
"""Two robots that meet in the middle."""


def kinds(motion: Motion, **obstacles: shapely.Polygon) -> set[str]:
    verdict = check_motion(motion, RADIUS, 2 * RADIUS, obstacles, {})
    assert verdict.certified == (not verdict.findings)
    return {finding.kind for finding in verdict.findings}


def test_a_motion_in_which_robots_meet_is_not_certified() -> None:
    assert kinds(STRAIGHT) == {"separation", "passage"}
    late = replace(STRAIGHT, times={"a": np.array([0.0, 1]), "b": np.array([5.0, 6])})
    assert kinds(late) == {"passage"}, "apart by the clock alone"
    gate = Passages(np.array([1]), np.array([40.0]), np.array([0]), np.array([60.0]))
    assert kinds(replace(late, passages=gate)) == set()
    early = replace(gate, past=np.array([45.0]))
    assert kinds(replace(late, passages=early)) == {"passage"}
    after = replace(gate, at=np.array([55.0]))
    assert kinds(replace(late, passages=after)) == {"passage"}


def test_a_motion_through_an_obstacle_is_not_certified() -> None:
    alone = Motion({"a": STRAIGHT.paths["a"]}, times={"a": STRAIGHT.times["a"]})
    assert kinds(alone) == set()
    assert kinds(alone, t1=shapely.box(40, -5, 60, 5)) == {"clearance"}
    assert kinds(alone, t1=shapely.box(40, 2, 60, 5)) == {"clearance"}, "bodies count"
    assert kinds(alone, t1=shapely.box(40, 3.1, 60, 5)) == set()
    assert kinds(alone, t1=shapely.box(102, -5, 120, 5)) == set(), "it ends so near to it"
    assert kinds(alone, t1=shapely.box(-5, -5, 2, 5)) == set(), "it starts on it and leaves it"
    assert kinds(alone, t1=shapely.box(-5, -60, 60, 60)) == {"clearance"}, "not by a short way"


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.integers(2, 12))
def test_the_closest_approach_is_that_of_many_moments(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    paths = {f"r{i}": rng.uniform(0, 400, (4, 2)) for i in range(n)}
    times = {robot: np.append(0.0, np.cumsum(rng.uniform(0.5, 2, 3))) for robot in paths}
    motion = Motion(paths, times=times)
    found = check_motion(motion, RADIUS, 2 * RADIUS, {}, {}).separation_px
    moments = np.linspace(0, motion.makespan, 4000)
    at = np.stack(
        [
            np.stack([np.interp(moments, times[r], paths[r][:, axis]) for axis in (0, 1)], axis=1)
            for r in paths
        ],
        axis=1,
    )
    seen = min(min_spacing(points) for points in at)
    assert found is not None
    assert found <= seen + 1e-3
    fastest = max(
        (np.linalg.norm(np.diff(paths[r], axis=0), axis=1) / np.diff(times[r])).max() for r in paths
    )
    assert found >= seen - fastest * moments[1] - 1e-3, "nor do two come nearer between moments"
