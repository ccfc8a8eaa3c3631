"""Places hardly farther apart than bodies are wide: what room robots would like gives way."""

from formup.benchmarks.bench_motion import planned
from formup.benchmarks.motion_scenes import RADIUS, scene


def test_robots_with_errors_reach_places_beside_which_only_their_bodies_pass() -> None:
    made = planned(scene(27, 300), error=0.05 * RADIUS)  # a cage: 6.03 px from place to place
    assert made.verdict.certified
    assert made.verdict.separation_px is not None
    assert made.verdict.separation_px >= 2 * RADIUS - 1e-3
