"""The command line on robots on MQTT: what waits for a yes, what is refused, exit codes."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.apps.main import main
from PIL import Image

Cli = Callable[..., tuple[int, str]]


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    pixels = np.full((300, 400, 3), 60, np.uint8)
    pixels[100:200, 200:300] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "scene.png")

    def run(*arguments: str) -> tuple[int, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["formup", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        assert isinstance(ended.value.code, int)
        out, err = capsys.readouterr()
        return ended.value.code, out or err

    return run


def test_nothing_moves_until_a_person_says_yes_to_that_plan(
    cli: Cli, lab: Callable[..., Any]
) -> None:
    there = lab(speed=200, pose_timeout=1.0, watchdog=1.0).simulate()
    before = there.robots.points.copy()
    words = ("run", "scene.png", "Surround it with 3 robots", "--box", "195,95,305,205")
    code, out = cli(*words, "--json", "--fleet", "lab.yaml", "--out", "run")
    assert (code, json.loads(out)["status"]) == (3, "needs_approval")
    assert abs(there.robots.points - before).max() == 0
    assert not there.told
    code, out = cli("resume", "run", "--approve", "--json")
    report = json.loads(out)
    assert (code, report["status"]) == (0, "deployed")
    wanted = np.array(report["positions"])
    assert abs(there.robots.points - wanted).max() < 1


def test_what_is_wrong_is_told_by_exit_codes(
    cli: Cli, lab: Callable[..., Any], tmp_path: Path
) -> None:
    there = lab()
    code, out = cli("fleet", "check", "lab.yaml", "--seconds", "0.3")
    assert (code, "0 of 3 robots can be driven." in out) == (4, True)
    there.simulate()
    code, out = cli("fleet", "check", "lab.yaml", "--seconds", "1")
    assert (code, "3 of 3 robots can be driven." in out) == (0, True)
    (tmp_path / "wrong.yaml").write_text("fleet: mqtt\nrobots: [a]\n")
    for command in (("fleet", "check"), ("fleet", "simulate")):
        code, out = cli(*command, "wrong.yaml")
        assert (code, "broker: field required" in out) == (2, True)


def test_the_schema_is_told(cli: Cli) -> None:
    code, out = cli("tools", "schema", "fleet")
    assert (code, len(json.loads(out)["oneOf"])) == (0, 5)
