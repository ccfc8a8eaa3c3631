"""Annotations of another picture or another frame are refused, with the frame that fits."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from formup.evals.tasks.annotations import PHOTOS
from formup.evals.tasks.frames import check_frame
from formup.evals.tasks.suites import write_suite
from formup.tools.errors import InputError
from PIL import Image

ENTRIES: list[dict[str, Any]] = json.loads((PHOTOS / "annotations.json").read_text("utf-8"))
COINS = next(e for e in ENTRIES if e["image"].endswith("us_coins.jpg"))
CARS = next(e for e in ENTRIES if e["image"].endswith("cars_two.jpg"))
Move = Callable[[float, float, float, float], tuple[float, float]]
MOVES: dict[str, Move] = {
    "rows before columns": lambda x, y, w, h: (y, x),
    "turned left": lambda x, y, w, h: (y, w - 1 - x),
    "turned right": lambda x, y, w, h: (h - 1 - y, x),
    "upside down": lambda x, y, w, h: (w - 1 - x, h - 1 - y),
    "y upwards": lambda x, y, w, h: (x, h - 1 - y),
    "mirrored": lambda x, y, w, h: (w - 1 - x, y),
    "normalised": lambda x, y, w, h: (x / w, y / h),
    "percent": lambda x, y, w, h: (100 * x / w, 100 * y / h),
    "twice as large": lambda x, y, w, h: (2 * x, 2 * y),
    "half as large": lambda x, y, w, h: (x / 2, y / 2),
}


def moved(entry: dict[str, Any], move: Move) -> dict[str, Any]:
    """The entry with every point of its outlines moved, by x, y, width and height."""
    size = entry["width"], entry["height"]
    things = [
        thing | {"polygon": [list(move(x, y, *size)) for x, y in thing["polygon"]], "holes": []}
        for thing in entry["objects"]
    ]
    return entry | {"objects": things}


def refused(entry: dict[str, Any], folder: Path = PHOTOS) -> str:
    with pytest.raises(InputError) as caught:
        check_frame(entry, folder)
    return str(caught.value)


def test_what_ships_is_in_our_frame_thing_by_thing() -> None:
    for entry in ENTRIES:
        check_frame(entry, PHOTOS)
        for thing in entry["objects"]:
            check_frame(entry | {"objects": [thing]}, PHOTOS)


@pytest.mark.parametrize("entry", [COINS, CARS], ids=["coins", "cars"])
@pytest.mark.parametrize("frame", MOVES)
def test_another_frame_is_refused_by_its_name(entry: dict[str, Any], frame: str) -> None:
    assert f"{frame}" in refused(moved(entry, MOVES[frame]))


def test_outlines_beside_the_picture() -> None:
    text = refused(moved(COINS, lambda x, y, w, h: (x + 2 * w, y)))
    assert "outside" in text
    assert "fit" not in text


def test_an_outline_cut_by_the_border_may_be_drawn_whole() -> None:
    coin = COINS["objects"][0]["polygon"]
    left = min(x for x, _ in coin)
    check_frame(
        COINS
        | {
            "objects": [
                thing | {"polygon": [[max(x, -3), y] for x, y in thing["polygon"]]}
                for thing in COINS["objects"]
            ]
        },
        PHOTOS,
    )
    assert left > 0


@pytest.mark.parametrize(
    "ring",
    [
        [[330, 128], [474, 380], [440, 128], [340, 380]],
        [[330, 128], [440, 128], [474, 380], [340, 380], [344, 360], [350, 395]],
    ],
)
def test_a_bow_tie_is_called_one(ring: list[list[int]]) -> None:
    first = CARS["objects"][0]
    assert f"{first['id']} in {CARS['image']} crosses itself" in refused(
        CARS | {"objects": [first | {"polygon": ring}]}
    )
    assert "crosses itself" in refused(CARS | {"objects": [first | {"holes": [ring]}]})


def test_another_picture_or_size_makes_no_suite(tmp_path: Path) -> None:
    assert "sha256" in refused(COINS | {"sha256": "0" * 64})
    bare = {k: v for k, v in COINS.items() if k != "sha256"}
    assert "439 x 568 px, but is shown with 568 x 439" in refused(
        bare | {"width": 439, "height": 568}
    )
    shutil.copy(PHOTOS / COINS["image"], tmp_path / "coins.jpg")
    image = Image.open(tmp_path / "coins.jpg")
    exif = image.getexif()
    exif[0x0112] = 6
    image.save(tmp_path / "coins.jpg", exif=exif)
    entry = bare | {"image": "coins.jpg"}
    (tmp_path / "annotations.json").write_text(json.dumps([entry]), "utf-8-sig")
    with pytest.raises(InputError, match="568 x 439 px, but is shown with 439 x 568"):
        write_suite(tmp_path, "coins")
    assert not (tmp_path / "suite.yaml").exists()
