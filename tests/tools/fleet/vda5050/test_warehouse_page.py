"""docs/warehouse.md from its first command to its last, and what its table of keys promises."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from formup.tools.fleet.mqtt.settings import BrokerSettings
from formup.tools.fleet.vda5050.settings import Vda5050Settings

ROOT = Path(__file__).parents[4]
PAGE = (ROOT / "docs/warehouse.md").read_text("utf-8")
COMMANDS = [
    line.removeprefix("$ ")
    for block in re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)
    for line in block.splitlines()
]
STAYING = ("mosquitto", "formup fleet simulate")


@pytest.fixture
def place(tmp_path: Path, brokers: Callable[..., Any]) -> Path:
    """A checkout whose examples are at a port that is free."""
    broker = brokers()
    broker.kill()
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    (tmp_path / "examples").mkdir()
    for name in ("warehouse.yaml", "mosquitto.conf"):
        text = (ROOT / "examples" / name).read_text("utf-8")
        assert "1883" in text
        (tmp_path / "examples" / name).write_text(text.replace("1883", str(broker.port)))
    return tmp_path


def test_the_page_gets_from_nothing_to_a_formation(place: Path) -> None:
    assert [command.split()[:3] for command in COMMANDS][-2:] == [
        ["formup", "run", "docs/images/lot.jpg"],
        ["formup", "deploy", "plan/plan.json"],
    ]
    home = os.environ | {
        "XDG_DATA_HOME": str(place),
        "PATH": f"{os.environ['PATH']}:/usr/sbin",
        "PYTHONUNBUFFERED": "1",
    }
    said: dict[str, str] = {}
    with ExitStack() as staying:
        for command in COMMANDS:
            parts = shlex.split(command)
            if parts[0] == "formup":
                parts = [sys.executable, "-m", *parts]
            if command.startswith(STAYING):
                goes_on = subprocess.Popen(
                    parts, cwd=place, env=home, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
                )
                staying.callback(goes_on.communicate)
                staying.callback(goes_on.kill)
                if command.startswith("formup"):
                    assert goes_on.stdout is not None
                    assert b"standing in for 6 robots" in goes_on.stdout.readline()
                continue
            done = subprocess.run(
                parts, cwd=place, env=home, capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, done.stdout + done.stderr
            said[" ".join(command.split()[:3])] = done.stdout
    assert "6 of 6 robots can be driven." in said["formup fleet check"]
    assert "planned:" in said["formup run docs/images/lot.jpg"]
    assert "deployed: All arrived" in said["formup deploy plan/plan.json"]


def test_the_table_has_the_keys_there_are() -> None:
    table = PAGE.partition("| key | |")[2].partition("\n\n")[0]
    keys = {
        key for row in table.splitlines()[2:] for key in re.findall(r"`(\w+)`", row.split("|")[1])
    }
    assert keys == set(Vda5050Settings.model_fields) - set(BrokerSettings.model_fields)
    for key in set(BrokerSettings.model_fields):
        assert f"`{key}`" in PAGE
