"""The drawn room is the truth that cameras are held against, so it is held against geometry."""

import math

import cv2
import numpy as np
import pytest
from formup.tools.draw.room import Room, Sheet, tag_sheet

ROBOTS = {3: (0.8, 0.7, 0.4), 7: (2.9, 0.9, -2.0), 11: (1.2, 2.3, 3.0)}
TOP = Room(tag_height=0.1)
ASKEW = Room(eye=(2.0, -0.8, 2.6), aim=(2.0, 1.3), view=80, distortion=(-0.2, 0.05, 0, 0, 0))


def corners_seen(frame: np.ndarray, room: Room) -> dict[int, np.ndarray]:
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, room.dictionary))
    corners, ids, _ = cv2.aruco.ArucoDetector(known).detectMarkers(frame)
    return {int(i): np.reshape(c, (4, 2)) for i, c in zip(np.ravel(ids), corners, strict=True)}


def corners_true(room: Room, tag: int) -> np.ndarray:
    x, y, heading = ROBOTS[tag]
    way = np.array([math.cos(heading), math.sin(heading)]) * room.tag_size / 2
    left = np.array([-way[1], way[0]])
    flat = [(x, y) + a * way + b * left for a, b in [(-1, 1), (1, 1), (1, -1), (-1, -1)]]
    return room.seen_at(np.column_stack([flat, [room.tag_height] * 4]))


@pytest.mark.parametrize("room", [TOP, ASKEW], ids=["straight above", "at an angle"])
def test_tags_are_seen_where_the_camera_has_them(room: Room) -> None:
    seen = corners_seen(room.frame(ROBOTS), room)
    assert set(seen) == set(ROBOTS)
    for tag, corners in seen.items():
        assert np.abs(corners - corners_true(room, tag)).max() < 1.5


def test_the_homography_takes_the_picture_to_the_floor() -> None:
    floor = np.array([(0.1, 0.2), (3.8, 0.3), (2.0, 2.9)])
    room = Room(eye=(2.0, -0.8, 2.6), aim=(2.0, 1.3))
    seen = room.seen_at(np.column_stack([floor, np.zeros(3)]))
    back = cv2.perspectiveTransform(seen[None], room.homography)[0]
    assert np.abs(back - floor).max() < 1e-9


def test_a_frame_depends_on_its_seed_alone() -> None:
    assert np.array_equal(TOP.frame(ROBOTS, seed=1), TOP.frame(ROBOTS, seed=1))
    assert not np.array_equal(TOP.frame(ROBOTS, seed=1), TOP.frame(ROBOTS, seed=2))


def test_noise_is_as_strong_as_asked() -> None:
    one, two = (TOP.frame({}, seed=seed).astype(float) for seed in (1, 2))
    assert np.std(one - two) == pytest.approx(2.0 * math.sqrt(2), rel=0.1)


def test_the_thing_stands_where_it_is_put() -> None:
    x, y = TOP.seen_at(np.array([(2.0, 1.5, TOP.thing[2])]))[0]
    blue, green, red = TOP.frame({}, thing=(2.0, 1.5, 0.3))[round(y), round(x)].tolist()
    assert red > green > blue
    assert np.ptp(TOP.frame({})[round(y), round(x)]) < 30


def test_a_sheet_lies_on_the_floor_the_right_way_round() -> None:
    tag = tag_sheet("DICT_4X4_50", 9, (1.0, 2.0, 0.5), 0.2)
    seen = corners_seen(Room(sheets=(tag,)).frame({}), TOP)[9]
    left_to_right = seen[1] - seen[0]
    assert math.atan2(-left_to_right[1], left_to_right[0]) == pytest.approx(0.5, abs=0.05)


def test_blur_smears_along_the_rows() -> None:
    lines = Sheet(np.tile(np.array([[0, 255]], np.uint8), (8, 40)), (2.0, 1.5, 0.0), 2.0)
    sharp, blurred = (Room(sheets=(lines,), blur=n).frame({})[360, 500:780] for n in (0, 25))
    assert np.std(blurred) < np.std(sharp) / 4
