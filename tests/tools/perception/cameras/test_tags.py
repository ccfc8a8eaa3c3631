"""Tags in drawn rooms, against where they are drawn."""

import math
from dataclasses import replace

import numpy as np
import pytest
from formup.tools.draw.room import Pose, Room
from formup.tools.errors import InputError
from formup.tools.perception.cameras.calibration import Calibration, Lens, Residuals
from formup.tools.perception.cameras.tags import heading, tags_in

ABOVE = Room(tag_height=0.1)
ASKEW = Room(eye=(2.0, -1.0, 2.6), aim=(2.0, 1.4), view=75, tag_height=0.1)
BENT = replace(ASKEW, distortion=(-0.2, 0.05, 0.0, 0.0, 0.0))
APRIL = replace(ASKEW, dictionary="DICT_APRILTAG_36h11")
EXACT = Residuals(mean_px=0, worst_px=0, mean_mm=0, worst_mm=0, corners_mm=0)


def calibration(room: Room) -> Calibration:
    """What is true of a room's camera."""
    values = {"camera_matrix": room.camera_matrix.tolist(), "distortion": room.distortion}
    return Calibration.model_validate(
        {
            "picture": room.picture,
            "homography": room.homography.tolist(),
            "lens": Lens.model_validate(values),
            "camera": room.eye,
            "floor": (0.2, 0.2, 3.8, 2.8),
            "metres_per_pixel": 0.005,
            "residuals": EXACT,
        }
    )


def poses_seen(room: Room, robots: dict[int, Pose], seed: int) -> dict[int, Pose]:
    found = tags_in(room.frame(robots, seed=seed), room.dictionary)
    known = calibration(room)
    corners = {tag: known.on_floor(seen, room.tag_height) for tag, seen in found.items()}
    return {
        tag: (float(four[:, 0].mean()), float(four[:, 1].mean()), heading(four))
        for tag, four in corners.items()
    }


@pytest.mark.parametrize(
    "room", [ABOVE, ASKEW, BENT, APRIL], ids=["above", "askew", "bent", "36h11"]
)
def test_a_room_of_robots_is_seen_to_the_millimetre(room: Room) -> None:
    rng, off, turned = np.random.default_rng(7), list[float](), list[float]()
    for seed in range(4):
        turns = rng.uniform(-math.pi, math.pi, 21)
        robots = {
            i: (0.35 + 0.55 * (i % 7), 0.4 + 0.6 * (i // 7), float(turn))
            for i, turn in enumerate(turns)
        }
        seen = poses_seen(room, robots, seed)
        assert len(set(robots) & set(seen)) >= 20  # one may not be found in one frame
        for tag in set(robots) & set(seen):
            (x, y, turn), (u, v, looks) = robots[tag], seen[tag]
            off.append(1000 * math.hypot(u - x, v - y))
            turned.append(abs(math.degrees(math.remainder(looks - turn, 2 * math.pi))))
    assert np.mean(off) < 3
    assert max(off) < 8
    assert max(turned) < 1


def test_without_its_height_a_tag_seems_further_off() -> None:
    robots: dict[int, Pose] = {3: (3.5, 2.5, 0.0)}
    x, y, _ = poses_seen(replace(ABOVE, tag_height=0.1), robots, 0)[3]
    assert math.hypot(x - 3.5, y - 2.5) < 0.003
    corners = tags_in(ABOVE.frame(robots), ABOVE.dictionary)[3]
    flat = calibration(ABOVE).on_floor(corners).mean(axis=0)
    assert math.dist(flat, (3.5, 2.5)) > 0.05


def test_a_height_takes_to_know_where_the_camera_is() -> None:
    blind = calibration(ABOVE).model_copy(update={"camera": None})
    with pytest.raises(InputError, match="does not say where the camera is"):
        blind.on_floor(np.array([(600.0, 300.0)]), 0.1)


def test_a_tag_that_is_there_twice_is_not_seen() -> None:
    one = ABOVE.frame({3: (1.0, 1.0, 0.0), 4: (3.0, 2.0, 0.0)})
    x, y = ABOVE.seen_at(np.array([(1.0, 1.0, 0.1)]))[0].round().astype(int)
    twice = one.copy()
    twice[y + 80 : y + 130, x - 25 : x + 25] = one[y - 25 : y + 25, x - 25 : x + 25]
    assert set(tags_in(twice, ABOVE.dictionary)) == {4}


def test_nothing_is_seen_on_an_empty_floor() -> None:
    assert tags_in(ABOVE.frame({}), ABOVE.dictionary) == {}
