"""`--mask FILE` in run, chat and eval add: things as other programs have outlined them."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.apps.main import main
from formup.evals.tasks.annotations import PHOTOS
from formup.evals.tasks.suites import load_suite
from PIL import Image

Cli = Callable[..., tuple[int, str, str]]
RED, BLUE = (
    [[60, 40], [120, 40], [120, 90], [60, 90]],
    [[240, 120], [300, 120], [300, 170], [240, 170]],
)


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
        monkeypatch.setattr(sys, "argv", ["formup", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, out, err

    return run


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A scene, a LabelMe file with its two boxes, and a PNG of the red one."""
    pixels = np.full((220, 360, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    pixels[120:170, 240:300] = (40, 60, 210)
    Image.fromarray(pixels).save(tmp_path / "scene.png")
    shapes = [
        {"label": name, "points": points, "shape_type": "polygon"}
        for name, points in (("crate", RED), ("barrel", BLUE))
    ]
    size = {"imageWidth": 360, "imageHeight": 220}
    (tmp_path / "both.json").write_text(json.dumps({"shapes": shapes, **size}))
    Image.fromarray(pixels[..., 0] == 200).save(tmp_path / "red.png")
    return tmp_path


def test_words_choose_among_the_things_of_a_file_by_their_labels(cli: Cli, files: Path) -> None:
    code, out, _ = cli(
        "run", "scene.png", "Surround the barrel", "-n", 6, "--plan-only", "--json",
        "--mask", "both.json",
    )  # fmt: skip
    report = json.loads(out)
    assert code == 0, report["message"]
    assert report["contract"]["groups"][0]["targets"] == ["t2"]
    (barrel,) = [t for t in report["targets"] if t["id"] == "t2"]
    assert (barrel["label"], barrel["found_from"]) == ("barrel", "mask")
    assert (barrel["confidence"], barrel["box"]) == (1.0, [239.5, 119.5, 299.5, 169.5])
    assert barrel["note"] == "Its mask is that of both.json."


def test_a_run_shows_what_a_thing_was_found_from(cli: Cli, files: Path) -> None:
    code, out, _ = cli(
        "run", "scene.png", "Surround it", "-n", 4, "--plan-only", "--mask", "red.png"
    )
    assert code == 0
    assert "confidence 1.00\n" in out
    assert "Its mask is that of red.png." in out


def test_a_chat_numbers_things_in_the_order_given(cli: Cli, files: Path) -> None:
    (files / "talk.txt").write_text("Surround t1 with 4 robots\nSurround t3 with 4 robots\n")
    code, out, err = cli(
        "chat", "scene.png", "--mask", "both.json", "--box", "55,35,125,95", "--json",
        "--script", "talk.txt",
    )  # fmt: skip
    assert code == 0, err
    first, second = map(json.loads, out.splitlines())
    assert {t["id"]: t["label"] for t in first["targets"]}["t1"] == "crate"
    boxed = next(t for t in second["targets"] if t["id"] == "t3")
    assert boxed["found_from"] == "box"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--mask", "nowhere.json"), "nowhere.json: No such file"),
        (("--mask", "scene.png"), "scene.png: it is a colour picture, no mask"),
        (("--mask", "."), "no file that can be read"),
    ],
)
def test_what_is_no_mask_is_one_sentence(
    cli: Cli, files: Path, given: tuple[str, ...], said: str
) -> None:
    code, out, err = cli("run", "scene.png", "Surround it", "-n", 4, *given)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err
    code, _, err = cli("chat", "--session", "s-1", "--mask", "red.png", "--script", "red.png")
    assert code == 2
    assert "--mask needs the picture" in err


def test_a_contract_of_ones_own_may_be_about_a_mask(cli: Cli, files: Path) -> None:
    ring = {"relation": "around", "targets": ["t2"], "robots": 6}
    (files / "contract.json").write_text(json.dumps({"groups": [ring]}))
    code, out, _ = cli(
        "run", "scene.png", "As it says", "--contract", "contract.json", "--plan-only", "--json",
        "--mask", "both.json",
    )  # fmt: skip
    assert code == 0
    assert [t["found_from"] for t in json.loads(out)["targets"] if t["id"] == "t2"] == ["mask"]


def test_eval_add_takes_objects_from_mask_files(cli: Cli, tmp_path: Path) -> None:
    entries: list[dict[str, Any]] = json.loads((PHOTOS / "annotations.json").read_text("utf-8"))
    entry = next(e for e in entries if e["image"].endswith("cars_two.jpg"))
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "cars.jpg").write_bytes((PHOTOS / entry["image"]).read_bytes())
    shapes = [{"label": o["name"], "points": o["polygon"]} for o in entry["objects"]]
    (folder / "cars.json").write_text(json.dumps({"shapes": shapes}))
    things = [
        {"id": o["id"], "name": o["name"], "mask": "cars.json", "thing": k}
        for k, o in enumerate(entry["objects"], start=1)
    ]
    mine = entry | {"image": "cars.jpg", "objects": things}
    (folder / "annotations.json").write_text(json.dumps([mine]))
    code, out, err = cli("eval", "add", folder)
    assert code == 0, err
    assert f"{len(entry['tasks'])} tasks" in out
    thing = load_suite(str(folder)).tasks[0].things[0]
    true = next(o for o in entry["objects"] if o["name"] == thing.name)
    assert len(thing.polygon) == len(true["polygon"])
    things[0].pop("thing")
    (folder / "suite.yaml").unlink()
    (folder / "annotations.json").write_text(json.dumps([mine]))
    code, _, err = cli("eval", "add", folder)
    assert code == 2
    assert '"thing": 1 to 2' in err
