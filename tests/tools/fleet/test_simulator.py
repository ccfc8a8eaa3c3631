"""The stepping core: what it promises of every drive, whatever the paths, seeds and faults."""

import math
from typing import Any

import numpy as np
import pytest
import shapely
from formup.tools.fleet.physics import Physics
from formup.tools.fleet.simulator import PERIOD, Simulator, tracking_error
from formup.tools.geometry.outline import FloatArray
from formup.tools.motion.motion import Motion, Passages, arc_lengths
from hypothesis import given, settings
from hypothesis import strategies as st

DRIVES = st.sampled_from(["point", "differential"])
SEEDS = st.integers(0, 2**32 - 1)
LONGEST = 2000
"""Steps after which a robot that nothing holds has arrived."""
SMOOTH: dict[str, Any] = {"speed": 160.0, "acceleration": 640.0, "radius": 4.0}


def paths_of(seed: int, robots: int = 4) -> list[FloatArray]:
    """Paths with bends of every kind, repeated vertices and ways there and back among them."""
    rng = np.random.default_rng(seed)
    paths: list[FloatArray] = []
    for _ in range(robots):
        legs = rng.uniform(-60, 60, (int(rng.integers(1, 8)), 2)) * rng.choice([0.02, 1, 1, 1])
        legs = np.concatenate([legs, np.repeat(legs[-1:] * 0, rng.integers(0, 2), axis=0)])
        if rng.random() < 0.3:
            legs = np.concatenate([legs, -legs[-1:]])
        if rng.random() < 0.3:
            bends = np.linspace(0, rng.uniform(-3, 3), 24)
            legs = 3 * np.stack([np.cos(bends), np.sin(bends)], axis=1)
        start = rng.uniform(0, 500, (1, 2))
        paths.append(np.concatenate([start, start + np.cumsum(legs, axis=0)]))
    return paths


def simulator(paths: list[FloatArray], physics: Physics, seed: int = 0) -> Simulator:
    ids = [str(i) for i in range(1, len(paths) + 1)]
    starts = np.array([path[0] for path in paths])
    return Simulator(ids, starts, np.full(len(paths), np.nan), physics, seed=seed)


def driven(
    paths: list[FloatArray], physics: Physics, *, seed: int = 0, passages: Passages | None = None
) -> tuple[Simulator, FloatArray, FloatArray]:
    """The simulator at its end, points (f, n, 2) and velocities on the way."""
    sim = simulator(paths, physics, seed)
    motion = Motion(
        dict(zip(sim.ids, paths, strict=True)),
        {"1": 1.0},
        passages=passages or Passages(),
    )
    sim.begin(motion)
    points, velocities = [sim.points.copy()], [sim.velocities.copy()]
    while not sim.arrived and len(points) < LONGEST:
        sim.step()
        points.append(sim.points.copy())
        velocities.append(sim.velocities.copy())
    return sim, np.array(points), np.array(velocities)


def furthest_off(paths: list[FloatArray], points: FloatArray) -> float:
    lines = [shapely.LineString(path) for path in paths]
    return max(
        float(shapely.distance(line, shapely.points(points[:, i])).max())
        for i, line in enumerate(lines)
    )


@settings(max_examples=40, deadline=None)
@given(DRIVES, SEEDS, st.sampled_from([0.0, 0.1, 0.25]))
def test_robots_keep_to_their_paths_and_limits_and_come_to_their_ends(
    drive: str, seed: int, delay: float
) -> None:
    physics = Physics.model_validate(SMOOTH | {"drive": drive, "delay": delay})
    paths = paths_of(seed)
    sim, points, velocities = driven(paths, physics)
    assert sim.arrived
    assert furthest_off(paths, points) <= tracking_error(physics)
    assert points[-1] == pytest.approx(np.array([path[-1] for path in paths]), abs=0.25)
    assert abs(math.remainder(sim.headings[0] - 1.0, math.tau)) <= 0.01
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2)
    assert steps.max() <= physics.speed * PERIOD * (1 + 1e-9)
    changes = np.diff(velocities, axis=0)
    if drive == "differential":  # wheels speed up; a robot that turns changes its velocity too
        changes = np.diff(np.linalg.norm(velocities, axis=2, keepdims=True), axis=0)
    assert np.linalg.norm(changes, axis=2).max() <= physics.acceleration * PERIOD * (1 + 1e-9)


FAULTS: list[dict[str, Any]] = [
    {"noise": {"actuation": 0.05}},
    {"noise": {"sensing": 0.5}},
    {"slip": 0.1},
    {"drop_outs": 0.3},
    {"noise": {"actuation": 0.05}, "delay": 0.1},
    {"noise": {"actuation": 0.05, "sensing": 0.5}, "drop_outs": 0.1, "slip": 0.05},
    {"stuck": [{"robot": 2, "after": 0.3, "lasting": 1}]},
]


@settings(max_examples=40, deadline=None)
@given(DRIVES, st.sampled_from(FAULTS), SEEDS)
def test_what_goes_wrong_keeps_within_the_bound_and_is_fixed_by_the_seed(
    drive: str, faults: dict[str, Any], seed: int
) -> None:
    physics = Physics.model_validate(SMOOTH | {"drive": drive} | faults)
    paths = paths_of(seed)
    sim, points, _ = driven(paths, physics, seed=seed)
    assert sim.arrived
    assert furthest_off(paths, points) <= tracking_error(physics)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2)
    assert steps.max() <= physics.speed * PERIOD * (1 + 1e-9)
    again, same, _ = driven(paths, physics, seed=seed)
    assert np.array_equal(points, same)
    assert np.array_equal(sim.sensed, again.sensed)


@settings(max_examples=20, deadline=None)
@given(DRIVES, SEEDS, st.integers(0, 60))
def test_robots_that_are_held_stand_at_once_and_take_up_another_motion(
    drive: str, seed: int, after: int
) -> None:
    physics = Physics.model_validate(SMOOTH | {"drive": drive, "delay": 0.1})
    sim = simulator(paths_of(seed), physics)
    sim.begin(Motion(dict(zip(sim.ids, paths_of(seed), strict=True))))
    for _ in range(after):
        sim.step()
    held = sim.points.copy()
    sim.hold()
    for _ in range(5):
        sim.step()
    assert np.array_equal(sim.points, held)
    assert not sim.velocities.any()
    sim.begin(Motion({"2": np.array([held[1], held[1] + 30.0])}))
    while not sim.arrived:
        sim.step()
    assert sim.points[1] == pytest.approx(held[1] + 30.0, abs=0.25)
    assert np.array_equal(np.delete(sim.points, 1, axis=0), np.delete(held, 1, axis=0))


@settings(max_examples=40, deadline=None)
@given(DRIVES, SEEDS, st.sampled_from([{}, {"delay": 0.15}, {"drop_outs": 0.4}, {"slip": 0.1}]))
def test_no_robot_comes_past_a_closed_passage(
    drive: str, seed: int, faults: dict[str, Any]
) -> None:
    physics = Physics.model_validate(SMOOTH | {"drive": drive} | faults)
    paths = paths_of(seed, 2)
    long = [float(arc_lengths(path)[-1]) for path in paths]
    passages = Passages(np.array([1]), np.array([long[1] / 2]), np.array([0]), np.array([long[0]]))
    stuck = physics.model_copy(update={"stuck": Physics.model_validate(
        SMOOTH | {"stuck": [{"robot": 1, "after": 0.2}]}).stuck})  # fmt: skip
    if long[0] < 5 or long[1] < 1:
        return
    sim = simulator(paths, stuck, seed)
    sim.begin(Motion(dict(zip(sim.ids, paths, strict=True)), passages=passages))
    line, went = shapely.LineString(paths[1]), 0.0
    for _ in range(300):
        before = sim.points[1].copy()
        sim.step()
        went += float(np.linalg.norm(sim.points[1] - before))
    assert went <= long[1] / 2 + 2.0
    there = shapely.line_interpolate_point(line, long[1] / 2)
    assert shapely.distance(there, shapely.Point(*sim.points[1])) <= tracking_error(physics) + 0.1
    assert driven(paths, physics, seed=seed, passages=passages)[0].arrived


def test_a_push_moves_a_robot_also_one_that_stands() -> None:
    pushes = [{"robot": 1, "at": 0.1, "by": [0, 7]}, {"robot": 2, "at": 0.1, "by": [3, 0]}]
    physics = Physics.model_validate(SMOOTH | {"pushes": pushes})
    still = [np.array([(0.0, 0.0), (90.0, 0.0)]), np.array([(0.0, 50.0), (0.0, 50.0)])]
    sim = simulator(still, physics)
    sim.begin(Motion({"1": still[0]}))
    while not sim.arrived:
        sim.step()
    assert sim.points == pytest.approx(np.array([(90.0, 0.0), (3.0, 50.0)]), abs=0.25)
