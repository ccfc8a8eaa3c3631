"""docs/fleets.md from its first command to its last, and what its table of keys promises."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from deploying import ROOT, checkout, commands_of, followed, keys_of
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


def test_the_table_has_the_keys_there_are() -> None:
    assert keys_of(PAGE) == set(MqttSettings.model_fields)
