"""A thing in drawn video is followed exactly, or said to be lost."""

from dataclasses import replace

import numpy as np
import pytest
from formup.benchmarks.drawn_video import Video
from formup.tools.errors import InputError
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.tracking.tracker import ObjectTracker
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

LOOKS = ("textured", "coloured", "grey")
FLOORS = ("plain", "textured")
LEAST = 0.95
DISTURBED = {
    "noise": Video(turn=2, noise=6),
    "robots go along": Video(turn=2, robots="follow"),
    "robots stay": Video(turn=2, robots="stay"),
    "darker": Video(turn=2, light=0.4),
    "shadow": Video(turn=2, shadow=True),
    "blur": Video(turn=2, blur=7),
    "partly covered": Video(turn=2, covered=0.2),
}


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("look", LOOKS)
@pytest.mark.parametrize("case", DISTURBED)
def test_it_is_followed_whatever_disturbs(case: str, look: str, floor: str) -> None:
    video = replace(DISTURBED[case], look=look, floor=floor, frames=24, seed=1)
    for seen in video.follow():
        assert not seen.tracked.lost, seen
        assert seen.overlap >= LEAST, seen


@settings(max_examples=8, deadline=None, phases=[Phase.explicit, Phase.generate])
@given(
    look=st.sampled_from(LOOKS),
    floor=st.sampled_from(FLOORS),
    shape=st.sampled_from(["box", "ell", "round"]),
    robots=st.sampled_from(["none", "follow", "stay"]),
    speed=st.floats(0, 5),
    turn=st.floats(-4, 4),
    noise=st.floats(2, 6),
    seed=st.integers(0, 999),
)
def test_it_is_followed_however_it_moves(
    look: str,
    floor: str,
    shape: str,
    robots: str,
    speed: float,
    turn: float,
    noise: float,
    seed: int,
) -> None:
    video = Video(look, shape, floor, speed, turn, frames=30, robots=robots, noise=noise, seed=seed)
    for seen in video.follow():
        if seen.tracked.lost:
            assert robots == "stay", seen  # they come to stand on the thing
        else:
            assert seen.overlap >= LEAST, seen


@pytest.mark.parametrize("floor", FLOORS)
@pytest.mark.parametrize("look", LOOKS)
def test_it_is_lost_while_covered_and_never_guessed(look: str, floor: str) -> None:
    video = Video(look, floor=floor, turn=1, speed=1, covered=1.1, frames=45)
    seen = list(video.follow())
    assert all(s.tracked.lost for s in seen if 15 <= s.frame < 30)
    assert all(s.overlap >= LEAST for s in seen if not s.tracked.lost)
    assert not any(s.tracked.lost for s in seen if s.frame < 15)


@pytest.mark.parametrize("look", LOOKS)
def test_one_that_waited_under_a_cover_is_found_again(look: str) -> None:
    seen = list(Video(look, speed=0, covered=1.1, frames=30).follow())
    assert all(s.tracked.lost for s in seen if 10 <= s.frame < 20)
    assert all(not s.tracked.lost and s.overlap >= LEAST for s in seen if s.frame >= 20)


@pytest.mark.parametrize("look", LOOKS)
def test_one_that_leaves_the_picture_is_lost(look: str) -> None:
    seen = list(Video(look, speed=8, leaves=True, frames=45).follow())
    assert seen[-1].tracked.lost
    assert not seen[5].tracked.lost
    assert all(s.overlap >= LEAST for s in seen if not s.tracked.lost)


def test_what_looks_like_the_floor_is_refused() -> None:
    floor = np.full((300, 400, 3), 120, np.uint8)
    outline = make_outline([(100, 100), (200, 100), (200, 180), (100, 180)])
    with pytest.raises(InputError, match="no texture"):
        ObjectTracker(floor, outline)
