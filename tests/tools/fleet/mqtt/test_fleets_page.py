"""docs/fleets.md from its first command to its last, and what its table of keys promises."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from deploying import ROOT, checkout, commands_of, followed, keys_of
from formup.tools.fleet.described import described_as
from formup.tools.fleet.mqtt.settings import MqttSettings

PAGE = (ROOT / "docs/fleets.md").read_text("utf-8")
COMMANDS = commands_of(PAGE)


def test_the_page_gets_from_nothing_to_a_formation(
    tmp_path: Path, brokers: Callable[..., Any]
) -> None:
    assert [command.split()[:3] for command in COMMANDS][-3:] == [
        ["formup", "run", "docs/images/lot.jpg"],
        ["formup", "deploy", "plan/plan.json"],
        ["formup", "fleet", "stop"],
    ]
    broker = brokers()
    broker.kill()
    place = checkout(tmp_path, "1883", str(broker.port), "lab.yaml", "mosquitto.conf")
    said = followed(COMMANDS, place)
    assert "6 of 6 robots can be driven." in said["formup fleet check"]
    assert "planned:" in said["formup run docs/images/lot.jpg"]
    assert "deployed: All arrived" in said["formup deploy plan/plan.json"]
    assert "6 robots were told to hold; all stand." in said["formup fleet stop"]


def test_stand_ins_start_where_the_page_says(tmp_path: Path) -> None:
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    path = tmp_path / "lab.yaml"
    path.write_text((ROOT / "examples/lab.yaml").read_text("utf-8") + block)
    settings = described_as(MqttSettings, path)
    first = settings.frame.to_picture(*settings.simulated.starts[0])
    assert first == pytest.approx((0.2 / 0.005, 506 - 0.3 / 0.005))


def test_the_table_has_the_keys_there_are() -> None:
    assert keys_of(PAGE) == set(MqttSettings.model_fields)
