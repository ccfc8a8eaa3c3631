"""The benchmark of motion on small scenes: what it measures is what it says."""

import math

import numpy as np
import pytest
from formup.benchmarks.bench_motion import bound, late_rows, measured, orca_rows, planned
from formup.benchmarks.motion_late import closest, late
from formup.benchmarks.motion_scenes import RADIUS, SPEED, Scene, scene
from formup.tools.geometry.sampling import min_spacing
from formup.tools.motion.motion import Motion, Passages

AROUND, INSIDE = 3, 12


@pytest.mark.parametrize(("seed", "robots"), [(AROUND, 3), (INSIDE, 4)])
def test_a_scene_is_the_same_again_and_ends_with_all_robots_at_their_places(
    seed: int, robots: int
) -> None:
    made, again = scene(seed, robots), scene(seed, robots)
    assert made.name == again.name
    np.testing.assert_array_equal(made.starts, again.starts)
    assert min_spacing(made.starts) >= 2 * RADIUS
    outcome = measured(made)
    assert outcome.why == ""
    assert outcome.arrived
    assert outcome.separation >= 1
    assert outcome.clearance >= 1
    assert outcome.over_bound >= 0.99  # corners are rounded with a few points


def test_the_bound_is_the_longest_way_that_some_robot_has_to_go() -> None:
    made = scene(INSIDE, 2)
    lined = Scene("", made.plan, made.site, made.goals + np.array([(30.0, 0.0), (10.0, 0.0)]))
    ways = np.linalg.norm(lined.starts[:, None] - lined.goals, axis=2)
    least = min(max(ways[0, 0], ways[1, 1]), max(ways[0, 1], ways[1, 0]))
    assert math.isclose(bound(lined), least / SPEED, rel_tol=1e-6)


def test_the_closest_approach_is_between_the_ends_of_a_step() -> None:
    begin, end = np.array([(0.0, 0.0), (10.0, 4.0)]), np.array([(10.0, 0.0), (0.0, 4.0)])
    assert closest(begin, end, 50.0) == pytest.approx(4.0)


def crossing(passages: Passages) -> Motion:
    paths = {"a": np.array([(0.0, 0.0), (100.0, 0.0)]), "b": np.array([(50.0, -50.0), (50.0, 50)])}
    return Motion(paths, passages=passages)


def test_robots_that_nothing_holds_are_seen_to_touch() -> None:
    ends = [late(crossing(Passages()), 6.0, np.random.default_rng(k), 0.0) for k in range(20)]
    assert min(end.least for end in ends) < 1
    assert all(end.arrived == 2 for end in ends)


def test_who_waits_for_a_robot_that_stopped_is_named() -> None:
    rows = Passages(np.array([1]), np.array([40.0]), np.array([0]), np.array([100.0]))
    ends = [late(crossing(rows), 6.0, np.random.default_rng(k), 0.5) for k in range(20)]
    assert all(end.least >= 1 and end.unnamed == 0 for end in ends)
    assert any(end.named for end in ends)


def test_tables_of_late_robots_and_of_pyrvo_are_made() -> None:
    assert "0 neither" in " ".join(late_rows(range(2), most=4))
    assert planned(scene(AROUND, 3), 0.0).verdict.certified
    assert [*orca_rows((3,), range(2))]
