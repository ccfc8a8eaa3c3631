"""Stand-ins at a real broker drive from pallet to pallet, each time at a person's yes."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def fleet(tmp_path: Path, brokers: Callable[..., Any]) -> Path:
    """The fleet's file, at the broker of the tests, with vehicles that are quicker."""
    text = (EXAMPLES / "warehouse.yaml").read_text("utf-8")
    for was, now in (("mqtt://127.0.0.1:1883", brokers().url), ("speed: 2.0 ", "speed: 6.0 ")):
        assert was in text
        text = text.replace(was, now)
    path = tmp_path / "warehouse.yaml"
    path.write_text(text, "utf-8")
    return path


def test_vehicles_stand_at_one_pallet_and_then_at_the_next(tmp_path: Path, fleet: Path) -> None:
    simulate = [sys.executable, "-u", "-m", "formup", "fleet", "simulate", str(fleet)]
    with subprocess.Popen(simulate, stdout=subprocess.PIPE, text=True) as stand_ins:
        try:
            assert stand_ins.stdout is not None
            assert "standing in for 6 robots" in stand_ins.stdout.readline()
            done = warehouse(fleet, tmp_path, "yes\nyes\n")
            refused = warehouse(fleet, tmp_path, "no\n")
        finally:
            stand_ins.kill()
    assert done.returncode == 0, done.stderr
    assert "red: arrived" in done.stdout and "blue: arrived" in done.stdout
    with Image.open(tmp_path / "warehouse.jpg") as picture:
        assert picture.height > picture.width
    assert refused.returncode == 1
    assert refused.stderr.startswith("red: ") and "arrived" not in refused.stdout


def warehouse(fleet: Path, folder: Path, answers: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "error", str(EXAMPLES / "warehouse.py"), str(fleet)]
    return subprocess.run(
        command, cwd=folder, input=answers, capture_output=True, text=True, check=False, timeout=300
    )
