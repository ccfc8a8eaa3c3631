"""`formup calibrate` on drawn rooms, and what `run` and `chat` make of its file."""

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from formup.apps.main import main
from formup.tools.draw.room import Room, Sheet, tag_sheet
from formup.tools.perception.cameras.calibration import read_calibration, through
from formup.tools.perception.image import load_picture

CORNERS = {1: (0.4, 0.4), 2: (3.6, 0.4), 3: (3.6, 2.6), 4: (0.4, 2.6), 5: (2.0, 0.9)}
TAGS = tuple(tag_sheet("DICT_4X4_50", tag, (*at, 0.3 * tag), 0.15) for tag, at in CORNERS.items())
ASKEW = Room(eye=(2.0, -1.0, 2.6), aim=(2.0, 1.4), view=75)
TAGGED = replace(ASKEW, sheets=TAGS)
BENT = replace(TAGGED, distortion=(-0.2, 0.05, 0.0, 0.0, 0.0))
PLACES = [(0.3, 0.3), (3.7, 0.4), (3.6, 2.7), (0.4, 2.6), (1.9, 1.2), (2.8, 2.0)]
Cli = Callable[..., tuple[int, str, str]]


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["formup", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        code = ended.value.code
        assert isinstance(code, int)
        return code, out, err

    return run


def draw(folder: Path, room: Room, **seen: Any) -> None:
    cv2.imwrite(str(folder / "lab.png"), room.frame({}, **seen))


def pixels(room: Room, places: list[tuple[float, float]]) -> list[list[float]]:
    return room.seen_at(np.column_stack([places, np.zeros(len(places))])).tolist()


def points(room: Room, places: list[tuple[float, float]] = PLACES) -> list[str]:
    """Options with points as a person clicks them, whole pixels."""
    pairs = zip(pixels(room, places), places, strict=True)
    return [part for (u, v), (x, y) in pairs for part in ("--point", f"{u:.0f},{v:.0f}={x},{y}")]


def write_lens(folder: Path, room: Room, **size: int) -> None:
    file = cv2.FileStorage(str(folder / "lens.yaml"), cv2.FILE_STORAGE_WRITE)
    for name, value in size.items():
        file.write(name, value)
    file.write("camera_matrix", room.camera_matrix)
    file.write("distortion_coefficients", np.array(room.distortion or (0.0,) * 5))
    file.release()


def write_known(folder: Path, **known: Any) -> None:
    (folder / "known.yaml").write_text(yaml.safe_dump(known))


def off_on_floor(folder: Path, room: Room) -> float:
    """By how much the file is off all over its floor, at worst, mm."""
    made = read_calibration(folder / "camera.yaml")
    x0, y0, x1, y1 = made.floor
    grid = [(x, y) for x in np.linspace(x0, x1, 9) for y in np.linspace(y0, y1, 9)]
    found = made.on_floor(np.array(pixels(room, grid)))
    return float(1000 * np.linalg.norm(found - grid, axis=1).max())


def refused(outcome: tuple[int, str, str], *words: str) -> None:
    code, out, err = outcome
    assert (code, out) == (2, ""), err
    assert err.startswith("formup: ")
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    for word in words:
        assert word in err, err


def test_points(cli: Cli, tmp_path: Path) -> None:
    draw(tmp_path, ASKEW)
    code, out, err = cli("calibrate", "lab.png", *points(ASKEW), "--out", "camera.yaml")
    assert code == 0, err
    assert "residuals   mean 0." in out
    assert off_on_floor(tmp_path, ASKEW) < 8
    assert load_picture(tmp_path / "camera.png").size == (667, 471)


def test_tags_and_a_lens(cli: Cli, tmp_path: Path) -> None:
    draw(tmp_path, BENT)
    write_lens(tmp_path, BENT, image_width=1280, image_height=720)
    write_known(tmp_path, tags={tag: list(at) for tag, at in CORNERS.items()}, lens="lens.yaml")
    code, out, err = cli("calibrate", "lab.png", "--known", "known.yaml", "--out", "camera.yaml")
    assert code == 0, err
    assert "above x 2.00 m, y -1.00 m, at a height of 2.60 m" in out
    assert off_on_floor(tmp_path, BENT) < 2


@pytest.mark.parametrize("marker", [None, 0.14], ids=["chessboard", "ChArUco"])
def test_a_board(cli: Cli, tmp_path: Path, marker: float | None) -> None:
    if marker is None:
        rows, columns = np.indices((240, 360)) // 40
        printed = np.where((rows + columns) % 2, 255, 0)
    else:
        family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        board = cv2.aruco.CharucoBoard((9, 6), 0.2, marker, family)
        printed = np.asarray(board.generateImage((360, 240)))
    bordered = np.pad(printed.astype(np.uint8), 40, constant_values=255)
    room = replace(ASKEW, sheets=(Sheet(bordered, (2, 1.5, 0), 0.2 * 11),))
    draw(tmp_path, room)
    board_known = {"squares": [9, 6], "square": 0.2, "marker": marker, "at": [1.3, 1.9]}
    write_known(tmp_path, board=board_known, floor=[0.4, 0.4, 3.6, 2.6])
    code, _, err = cli("calibrate", "lab.png", "--known", "known.yaml", "--out", "camera.yaml")
    assert code == 0, err
    assert off_on_floor(tmp_path, room) < 10


def test_the_floor_may_be_said_with_y_down(cli: Cli, tmp_path: Path) -> None:
    draw(tmp_path, TAGGED)
    write_known(tmp_path, tags={tag: [x, 3 - y] for tag, (x, y) in CORNERS.items()})
    assert cli("calibrate", "lab.png", "--known", "known.yaml", "--out", "camera.yaml")[0] == 0
    made = read_calibration(tmp_path / "camera.yaml")
    assert not made.y_up
    assert through(made.to_top, np.array([(0.4, 0.4)]))[0] == pytest.approx((-0.5, -0.5), abs=0.1)


MOVED = points(ASKEW)
MOVED[5] = MOVED[5].replace("=3.6,2.7", "=3.1,2.7")
SWAPPED = points(ASKEW, PLACES[:4])
SWAPPED[1], SWAPPED[3] = (
    SWAPPED[1].partition("=")[0] + "=3.7,0.4",
    SWAPPED[3].partition("=")[0] + "=0.3,0.3",
)
ON_A_LINE = points(ASKEW, [(0.5, 1.5), (1.5, 1.5), (2.5, 1.5), (3.5, 1.5)])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (points(ASKEW, PLACES[:3]), "3 points are known"),
        (ON_A_LINE, "on one line"),
        (MOVED, "Points do not fit one flat floor:"),
        (SWAPPED, "beyond the horizon"),
        ([*points(ASKEW), "--point", "1400,20=1,1"], "Point 1400,20 is outside the picture"),
        ([*points(ASKEW), "--point", "1,2"], "--point '1,2' cannot be read"),
        ([], "either --known FILE or at least four --point"),
    ],
)
def test_points_that_cannot_be(cli: Cli, tmp_path: Path, arguments: list[str], words: str) -> None:
    draw(tmp_path, ASKEW)
    refused(cli("calibrate", "lab.png", *arguments, "--out", "camera.yaml"), words)
    assert not (tmp_path / "camera.yaml").exists()


def test_the_one_point_that_is_off_is_named(cli: Cli, tmp_path: Path) -> None:
    draw(tmp_path, ASKEW)
    _, _, err = cli("calibrate", "lab.png", *MOVED, "--out", "camera.yaml")
    assert err.partition("floor: ")[2].startswith(MOVED[5].partition("=")[0] + " by ")
    assert err.count(" by ") == 1


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({"tags": {1: [0, 0], 9: [1, 1]}}, "Tag 9 of DICT_4X4_50 is not seen once"),
        ({"points": []}, "give one of points, tags and board"),
        ({"board": {"squares": [9, 6], "square": 0.1}}, "give floor too"),
        ({"board": {"squares": [9, 6], "square": 0.1}, "floor": [0, 0, 4, 3]}, "No chessboard of"),
        ({"tags": {1: [0, 0]}, "colour": 3}, "colour: no such key"),
        ({"tags": CORNERS, "floor": [0, -4, 4, 3]}, "is not all in the picture"),
        ({"tags": CORNERS, "lens": "lens.yaml"}, "is for pictures of 640 x 480"),
        ({"tags": CORNERS, "lens": "none.yaml"}, "none.yaml cannot be read"),
        ({"tags": CORNERS, "lens": "known.yaml"}, "holds no lens"),
    ],
)
def test_what_is_known_that_cannot_be(
    cli: Cli, tmp_path: Path, known: dict[str, Any], words: str
) -> None:
    draw(tmp_path, TAGGED)
    write_lens(tmp_path, TAGGED, image_width=640, image_height=480)
    write_known(tmp_path, **json.loads(json.dumps(known), object_hook=_numbers))
    refused(cli("calibrate", "lab.png", "--known", "known.yaml", "--out", "camera.yaml"), words)


def _numbers(found: dict[str, Any]) -> dict[Any, Any]:
    return {int(key) if key.isdigit() else key: value for key, value in found.items()}


@pytest.fixture
def calibrated(cli: Cli, tmp_path: Path) -> Path:
    draw(tmp_path, TAGGED)
    write_known(tmp_path, tags={tag: list(at) for tag, at in CORNERS.items()})
    assert cli("calibrate", "lab.png", "--known", "known.yaml", "--out", "camera.yaml")[0] == 0
    cv2.imwrite(str(tmp_path / "lab.png"), ASKEW.frame({}, thing=(2.0, 1.6, 0.3)))
    return tmp_path / "camera.yaml"


SAY = ("Surround the box with 6 robots 30 cm from it", "--json", "--out", "plan")


def test_a_run_sees_the_floor_from_above_in_metres(cli: Cli, calibrated: Path) -> None:
    code, out, err = cli("run", "lab.png", *SAY, "--calibration", "camera.yaml")
    assert code == 0, err
    said, made = json.loads(out), read_calibration(calibrated)
    assert (said["image"]["width"], said["image"]["height"]) == made.size
    to_floor = np.linalg.inv(made.to_top)
    stand = through(to_floor, np.array(said["positions"]))
    assert np.linalg.norm(stand - (2.0, 1.75), axis=1).max() < 0.9
    outline = through(to_floor, np.array(said["targets"][0]["outline"]))
    gaps = np.linalg.norm(stand[:, None] - outline[None], axis=2).min(axis=1)
    assert 0.28 < gaps.min() < 0.4


def test_its_picture_is_found_again(cli: Cli, calibrated: Path) -> None:
    planned = cli("run", "lab.png", *SAY, "--calibration", "camera.yaml", "--plan-only")
    assert planned[0] == 0, planned[2]
    (calibrated.parent / "lab.png").unlink()
    code, out, err = cli("deploy", "plan/plan.json")
    assert code == 0, err
    assert "deployed" in out
    code, out, err = cli("resume", "plan", "Use 5 robots", "--json")
    assert code == 0, out
    assert json.loads(out)["status"] == "planned", out


def test_a_camera_takes_the_picture(cli: Cli, calibrated: Path) -> None:
    code, out, err = cli("run", *SAY, "--camera", "lab.png", "--calibration", "camera.yaml")
    assert code == 0, err
    assert json.loads(out)["status"] == "deployed"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("lab.png", "Go", "--camera", "0"), "Both 'lab.png' and --camera give a picture"),
        (("lab.png",), "give IMAGE and INSTRUCTION"),
        (("Go", "--camera", "none.avi"), "Camera none.avi cannot be opened"),
        (("small.png", "Go", "--calibration", "camera.yaml"), "but camera.yaml is for 1280 x 720"),
        (("lab.png", "Go", "--calibration", "known.yaml"), "does not describe a camera"),
        (
            ("lab.png", "Go", "--calibration", "camera.yaml", "--metres-per-pixel", "0.1"),
            "leave out --metres-per-pixel",
        ),
    ],
)
def test_what_cannot_be_taken(
    cli: Cli, calibrated: Path, arguments: tuple[str, ...], words: str
) -> None:
    cv2.imwrite(str(calibrated.parent / "small.png"), np.zeros((90, 160, 3), np.uint8))
    refused(cli("run", *arguments), words)


def test_a_chat_is_about_what_the_camera_sees(cli: Cli, calibrated: Path) -> None:
    (calibrated.parent / "talk.txt").write_text("Surround the box with 5 robots\n")
    given = ("--camera", "lab.png", "--calibration", "camera.yaml", "--plan-only")
    code, out, err = cli("chat", *given, "--script", "talk.txt", "--json", "--out", "talk")
    assert code == 0, err
    said = json.loads(out.splitlines()[0])
    assert len(said["positions"]) == 5
    assert said["image"]["width"] == read_calibration(calibrated).size[0]


def test_a_chat_without_a_picture_has_nothing_to_rectify(cli: Cli, calibrated: Path) -> None:
    refused(cli("chat", "--calibration", "camera.yaml"), "--calibration needs a picture")
