"""docs/ros.md from its first command to its last, and what its tables promise."""

import re
import socket
from pathlib import Path

import pytest
from deploying import ROOT, checkout, commands_of, followed, keys_of
from formup.tools.fleet.recording import RecordedSettings
from formup.tools.fleet.ros.settings import RosSettings
from formup.tools.fleet.wire.settings import WireSettings

PAGE = (ROOT / "docs/ros.md").read_text("utf-8")
COMMANDS = commands_of(PAGE)


def test_the_page_gets_from_nothing_to_a_formation(tmp_path: Path) -> None:
    pytest.importorskip("websockets", reason="the extra ros is not installed")
    assert COMMANDS[0] == "formup fleet simulate examples/ros.yaml"
    assert COMMANDS[-1] == "formup fleet stop examples/ros.yaml"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    said = followed(COMMANDS, checkout(tmp_path, ":9090", f":{port}", "ros.yaml"))
    assert "6 of 6 robots can be driven." in said["formup fleet check"]
    assert "planned:" in said["formup run docs/images/lot.jpg"]
    assert "deployed: All arrived" in said["formup deploy plan/plan.json"]
    assert "6 robots were told to hold; all stand." in said["formup fleet stop"]


def test_the_tables_have_the_keys_there_are() -> None:
    shared = set(re.findall(r"`(\w+)`", PAGE.partition("have (")[2].partition(")")[0]))
    assert keys_of(PAGE) | shared == set(RosSettings.model_fields)
    assert shared == set(WireSettings.model_fields) - {"frame"}
    recorded = PAGE.partition("```yaml")[2].partition("```")[0]
    assert set(re.findall(r"^(\w+):", recorded, re.MULTILINE)) == {
        "fleet",
        *RecordedSettings.model_fields,
    }
