"""A team at a real broker cages a box that a camera sees moving: the drawn room, command lines."""

import json
import math
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from formup.apps.main import main
from formup.tools.draw.room import Pose, Room
from formup.tools.perception.cameras.calibration import Calibration, Residuals, through
from numpy.typing import NDArray

ROOM = Room(
    size=(2.4, 1.8),
    eye=(1.2, 0.9, 1.8),
    aim=(1.2, 0.9),
    picture=(640, 360),
    tag_height=0.05,
    thing=(0.45, 0.3, 0.03),
)
rows: Any = ROOM.homography.tolist()
SEEN = Calibration(
    picture=ROOM.picture,
    homography=rows,
    camera=ROOM.eye,
    floor=(0.1, 0.1, 2.3, 1.7),
    metres_per_pixel=0.005,
    residuals=Residuals(mean_px=0, worst_px=0, mean_mm=0, worst_mm=0, corners_mm=0),
)
BOX, SPEED = (0.8, 1.0, 0.2), 0.02
TAGS = {f"r{i}": i for i in range(8)}
TEAM: dict[str, Any] = {
    "robots": [*TAGS],
    "speed": 0.3,
    "radius": 0.1,
    "tracking_error": 0.02,
    "pose_timeout": 2,
    "watchdog": 2,
    "simulated": {"starts": [[0.25 + 0.25 * i, 0.25] for i in range(8)], "drive": "differential"},
    "camera": {
        "source": 0,
        "calibration": "camera.yaml",
        "tags": TAGS,
        "tag_size": 0.1,
        "tag_height": 0.05,
    },
}
Labs = Callable[..., Any]


class Floor:
    """In `cv2.VideoCapture`'s place: the stand-ins about a box that moves once they are there.

    Attributes:
        off: how far robots were about another middle than the box's, px, and when it had moved for.
    """

    def __init__(self) -> None:
        self.lab: Any = None
        self.places: NDArray[np.float64] | None = None
        self.covered_after, self.begun, self.over = math.inf, math.inf, threading.Event()
        self._frames, self.off = 0, list[tuple[float, float]]()

    def __call__(self, source: int) -> "Floor":
        return self

    def isOpened(self) -> bool:  # noqa: N802
        return True

    def set(self, name: int, value: float) -> bool:
        return True

    def release(self) -> None:
        """Nothing is held."""

    @property
    def since(self) -> float:
        return max(time.monotonic() - self.begun, 0.0)

    @property
    def box(self) -> Pose:
        return BOX[0] + SPEED * self.since, BOX[1], BOX[2] + 0.02 * self.since

    def read(self) -> tuple[bool, NDArray[np.uint8]]:
        self.over.wait(0.03)
        points = self.lab.robots.points.copy()
        if self.places is not None and math.isinf(self.begun):
            off = np.linalg.norm(points[:, None] - self.places, axis=2).min(axis=0)
            if off.max() < 2:
                self.begun = time.monotonic() + 2
        since, middle = self.since, through(SEEN.to_top, np.array([self.box[:2]]))[0]
        self.off.append((since, float(np.linalg.norm(points.mean(axis=0) - middle))))
        floor = through(np.linalg.inv(SEEN.to_top), points).tolist()
        seen = {tag: (x, y, 0.3) for tag, (x, y) in zip(TAGS.values(), floor, strict=True)}
        self._frames += 1
        frame = ROOM.frame(seen, thing=self.box, seed=self._frames)
        if self.since > self.covered_after:
            corners = np.array([(-0.24, -0.16), (0.24, -0.16), (0.24, 0.16), (-0.24, 0.16)])
            x, y, turn = self.box
            c, s = math.cos(turn), math.sin(turn)
            around = corners @ np.array([[c, s], [-s, c]]) + (x, y)
            there = ROOM.seen_at(np.column_stack([around, np.full(4, ROOM.thing[2])]))
            cv2.fillPoly(frame, [np.round(there).astype(np.int32)], (90, 140, 60))
        return True, frame


@pytest.fixture
def floor(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, lab: Labs) -> Any:
    (tmp_path / "camera.yaml").write_text(SEEN.to_yaml())
    camera = Floor()
    monkeypatch.setattr(cv2, "VideoCapture", camera)
    camera.lab = lab(**TEAM).simulate()
    yield camera
    camera.over.set()


@pytest.fixture
def command(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Callable[..., tuple[int, dict[str, Any]]]:
    """Runs a command line in the folder; its exit code and its report."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[int, dict[str, Any]]:
        monkeypatch.setattr(sys, "argv", ["formup", *arguments, "--json"])
        with pytest.raises(SystemExit) as ended:
            main()
        assert isinstance(ended.value.code, int)
        out, err = capsys.readouterr()
        assert out, err
        return ended.value.code, json.loads(out)

    return run


def caged(floor: Floor, command: Callable[..., Any], seconds: float) -> tuple[int, dict[str, Any]]:
    """Plan a cage on what the camera sees, drive there and follow; exit code and report."""
    cv2.imwrite("room.png", floor.read()[1])
    corners = np.array([(-0.23, -0.155), (0.23, -0.155), (0.23, 0.155), (-0.23, 0.155)])
    c, s = math.cos(BOX[2]), math.sin(BOX[2])
    outline = through(SEEN.to_top, corners @ np.array([[c, s], [-s, c]]) + BOX[:2])
    drawn = ",".join(f"{value:.1f}" for value in outline.ravel())
    code, report = command(
        *("run", "room.png", "Cage the box with 8 robots", "--robot-radius", "20"),
        *("--calibration", "camera.yaml"),
        *("--outline", drawn, "--fleet", "lab.yaml", "--plan-only", "--out", "out"),
    )
    assert code == 0, report
    floor.places = np.array(report["positions"])
    return command("deploy", "out/plan.json", "--fleet", "lab.yaml", "--follow", str(seconds))


def test_a_team_cages_a_box_that_a_camera_sees_moving(floor: Floor, command: Any) -> None:
    code, report = caged(floor, command, 10)
    came = report["arrival"]["follow"]
    assert (code, came["ended"]) == (0, "time"), report["message"]
    assert came["certified"] > 0.95, came
    way = SPEED * 8 / SEEN.metres_per_pixel
    assert 0.8 * way < came["moved_px"] < 1.3 * way, came
    assert max(off for since, off in floor.off if 0 < since < 7) < 6


def test_robots_hold_when_the_box_is_covered(floor: Floor, command: Any) -> None:
    floor.covered_after = 3
    code, report = caged(floor, command, 60)
    came = report["arrival"]["follow"]
    assert (code, came["ended"]) == (4, "unseen"), report["message"]
    assert "t1 was not seen for" in report["message"]
    before = floor.lab.robots.points.copy()
    time.sleep(0.5)
    assert np.abs(floor.lab.robots.points - before).max() < 1
