"""docs/ros.md from its first command to its last, and what its tables promise."""

import os
import re
import shlex
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest
from formup.tools.fleet.recording import RecordedSettings
from formup.tools.fleet.ros.settings import RosSettings
from formup.tools.fleet.wire.settings import WireSettings

ROOT = Path(__file__).parents[4]
PAGE = (ROOT / "docs/ros.md").read_text("utf-8")
COMMANDS = [
    line.removeprefix("$ ")
    for block in re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
    for line in block.splitlines()
]


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A checkout whose example is at a port that is free."""
    pytest.importorskip("websockets", reason="the extra ros is not installed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    (tmp_path / "examples").mkdir()
    text = (ROOT / "examples/ros.yaml").read_text("utf-8")
    assert ":9090" in text
    (tmp_path / "examples/ros.yaml").write_text(text.replace(":9090", f":{port}"))
    return tmp_path


def test_the_page_gets_from_nothing_to_a_formation(place: Path) -> None:
    simulate, *others = COMMANDS
    assert simulate == "formup fleet simulate examples/ros.yaml"
    assert others[-1] == "formup deploy plan/plan.json --fleet examples/ros.yaml"
    home = os.environ | {"XDG_DATA_HOME": str(place), "PYTHONUNBUFFERED": "1"}
    said: dict[str, str] = {}
    with ExitStack() as staying:
        stand_ins = subprocess.Popen(
            [sys.executable, "-m", *shlex.split(simulate)],
            cwd=place,
            env=home,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        staying.callback(stand_ins.communicate)
        staying.callback(stand_ins.kill)
        assert stand_ins.stdout is not None
        assert b"standing in for 6 robots" in stand_ins.stdout.readline()
        for command in others:
            done = subprocess.run(
                [sys.executable, "-m", *shlex.split(command)],
                cwd=place,
                env=home,
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stdout + done.stderr
            said[" ".join(command.split()[:2])] = done.stdout
    assert "6 of 6 robots can be driven." in said["formup fleet"]
    assert "planned:" in said["formup run"]
    assert "deployed: All arrived" in said["formup deploy"]


def test_the_tables_have_the_keys_there_are() -> None:
    table = PAGE.partition("| key | |")[2].partition("\n\n")[0]
    keys = {
        key for row in table.splitlines()[2:] for key in re.findall(r"`(\w+)`", row.split("|")[1])
    }
    shared = set(re.findall(r"`(\w+)`", PAGE.partition("have (")[2].partition(")")[0]))
    assert keys | shared == set(RosSettings.model_fields)
    assert shared == set(WireSettings.model_fields) - {"frame"}
    recorded = PAGE.partition("```yaml")[2].partition("```")[0]
    assert set(re.findall(r"^(\w+):", recorded, re.MULTILINE)) == {
        "fleet",
        *RecordedSettings.model_fields,
    }
