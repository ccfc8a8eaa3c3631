"""In which frame a model writes is read off five marks."""

import numpy as np
import pytest
from formup.evals.experiments.coordinate_frame import MARKS, SIZE, Frame, frame_of

TRUTH = np.array(list(MARKS.values())) * SIZE
FRAMES = [
    Frame(),
    Frame(swapped=True),
    *(Frame(swapped=swapped, parts=parts) for swapped in (False, True) for parts in (1, 100, 1000)),
    *(Frame(swapped=swapped, long=long) for swapped in (False, True) for long in (640, 1568)),
]


def written(frame: Frame, off: float = 0.0) -> tuple[tuple[float, float], ...]:
    """The marks as a model writes them in a frame, each off by so many pixels."""
    points = TRUTH + off
    points = points / SIZE * frame.parts if frame.parts else points
    points = points * frame.long / max(SIZE) if frame.long else points
    points = points[:, ::-1] if frame.swapped else points
    return tuple((float(x), float(y)) for x, y in points)


@pytest.mark.parametrize("frame", FRAMES, ids=lambda frame: frame.name or "pixels")
@pytest.mark.parametrize("off", [0.0, 6.0])
def test_a_frame_is_known_by_marks_a_little_off(frame: Frame, off: float) -> None:
    found = frame_of(written(frame, off))
    assert found.comparable
    assert (found.frame.swapped, found.frame.parts) == (frame.swapped, frame.parts)
    assert found.frame.long == pytest.approx(frame.long, rel=0.02)
    back = found.frame.pixels(written(frame), SIZE)
    assert np.abs(np.array(back) - TRUTH).max() < 12


def test_a_frame_scales_with_the_picture() -> None:
    assert Frame(swapped=True, parts=1000).pixels(((500, 250),), (400, 200)) == ((100, 100),)
    assert Frame(long=800).pixels(((80, 40),), (400, 200)) == ((40, 20),)
    assert Frame().name is None
    assert Frame(swapped=True, long=800).name == "y before x, pixels of 800"


def test_guesses_are_comparable_in_no_frame() -> None:
    found = frame_of(((10, 10), (900, 20), (20, 600), (700, 700), (400, 30)))
    assert not found.comparable
    assert found.error > 0.02
