"""What a person sees of networks: chosen by name, said to be missing, asked by words."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest


def formup(*words: str | Path, **environment: str) -> tuple[int, dict[str, Any], str]:
    """Run the command; exit code, report, and what it says beside."""
    done = subprocess.run(
        [sys.executable, "-m", "formup", "run", *map(str, words), "--plan-only", "--json"],
        capture_output=True,
        text=True,
        env=os.environ | environment,
    )
    return done.returncode, json.loads(done.stdout or "{}"), done.stderr


def test_a_thing_that_no_rule_knows_is_found_by_its_noun(
    checkpoints: Path, red_file: Path, tmp_path: Path
) -> None:
    chosen = ("--segmenter", f"clipseg:{checkpoints / 'clipseg'}", "--out", tmp_path / "out")
    code, report, _ = formup(red_file, "Surround the fork", "-n", "6", *chosen)
    assert code == 0
    assert report["verdict"]["certified"]
    (target,) = report["targets"]
    assert target["label"] == "fork"
    assert target["confidence"] > 0.5
    assert "found as fork" in report["message"]


def test_what_the_masks_of_the_pair_are_worth_is_held_against_t(
    checkpoints: Path, red_file: Path, tmp_path: Path
) -> None:
    pair = f"langsam:{checkpoints / 'groundingdino'},{checkpoints / 'sam'}"
    chosen = ("--segmenter", pair, "--box", "80,60,160,120", "--out", tmp_path / "out")
    code, report, _ = formup(red_file, "Surround it", "-n", "6", *chosen)
    assert (code, report["status"]) == (0, "planned")
    code, report, _ = formup(red_file, "Surround it", "-n", "6", "--threshold", "0.99", *chosen)
    assert code == 3
    assert "Insufficient segmentation accuracy." in report["message"]
    assert "Draw a rough outline" in report["message"]


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("clipseg:no/such/folder", "There is no checkpoint 'no/such/folder': give a folder"),
        ("clipseg:{0}/sam", "holds a network of the kind 'sam', not clipseg"),
        ("sam:facebook/sam-vit-huge", "is not on this machine and cannot be downloaded"),
        ("sam:{0}", "holds no checkpoint: it needs config.json"),
        ("grabcut:{0}", "takes no checkpoint"),
    ],
)
def test_what_cannot_be_loaded_is_one_sentence_before_anything_is_done(
    checkpoints: Path, red_file: Path, tmp_path: Path, name: str, said: str
) -> None:
    chosen = ("--segmenter", name.format(checkpoints), "--out", tmp_path / "out")
    code, report, err = formup(red_file, "Surround it", *chosen, HF_HOME=str(tmp_path))
    assert code == 2
    assert said in report.get("message", "") + err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("FORMUP_DEVICE", "toaster"),
        ("FORMUP_DTYPE", "int3"),
        ("FORMUP_DETECTION_THRESHOLD", "high"),
    ],
)
def test_settings_of_the_machine_are_checked(
    checkpoints: Path, red_file: Path, tmp_path: Path, variable: str, value: str
) -> None:
    chosen = ("--segmenter", f"clipseg:{checkpoints / 'clipseg'}", "--out", tmp_path / "out")
    code, report, err = formup(red_file, "Surround it", *chosen, **{variable: value})
    assert code == 2
    assert f"{variable}='{value}'" in report.get("message", "") + err


def test_segmentation_alone_is_a_method_of_evals(checkpoints: Path, tmp_path: Path) -> None:
    network = f"clipseg:{checkpoints / 'clipseg'}"
    method = ("--method", "segment-only", "--model", network, "--task", "us_coins_t1")
    words = ("eval", "run", "smoke", *method, "--out", str(tmp_path / "out"))
    done = subprocess.run(
        [sys.executable, "-m", "formup", *words], capture_output=True, text=True, check=False
    )
    (line,) = (tmp_path / "out/trials.jsonl").read_text("utf-8").splitlines()
    row = json.loads(line)
    assert (row["arm"]["method"], row["arm"]["model"]) == ("segment-only", network)
    assert row["status"] in ("pass", "fail"), done.stderr
