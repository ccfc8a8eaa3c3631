"""The file of vehicles of VDA 5050: what is left out, and every mistake."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from formup.tools.errors import InputError
from formup.tools.fleet.described import described_as, fleet_named
from formup.tools.fleet.vda5050.settings import Vda5050Settings

USUAL: dict[str, Any] = {
    "fleet": "vda5050",
    "broker": "mqtt://localhost",
    "version": "3.0",
    "interface": "vda5050",
    "manufacturer": "KIT",
    "map": "hall",
    "robots": ["a", 2],
    "speed": 1,
    "radius": 1,
    "tracking_error": 1,
}


def written(folder: Path, **more: Any) -> Path:
    path = folder / "hall.yaml"
    given = {key: value for key, value in {**USUAL, **more}.items() if value is not None}
    path.write_text(yaml.safe_dump(given))
    return path


def test_robots_are_serial_numbers_or_are_named(tmp_path: Path) -> None:
    vehicles = {"a": {"serial": "0017"}, 2: {"serial": 18, "manufacturer": "ACME"}}
    found = described_as(Vda5050Settings, written(tmp_path))
    assert [found.topic(robot, "order") for robot in found.robots] == [
        "vda5050/v3/KIT/a/order",
        "vda5050/v3/KIT/2/order",
    ]
    found = described_as(Vda5050Settings, written(tmp_path, version="2.1", vehicles=vehicles))
    assert [found.topic(robot, "state") for robot in (*found.robots, "+")] == [
        "vda5050/v2/KIT/0017/state",
        "vda5050/v2/ACME/18/state",
        "vda5050/v2/+/+/state",
    ]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"version": "2.0"}, r"version: input should be '2\.1' or '3\.0', got '2\.0'"),
        ({"version": 2.1}, r"version: input should be '2\.1' or '3\.0', got 2\.1"),
        ({"version": None}, "version: field required"),
        ({"interface": "a/b"}, "interface: string should match"),
        ({"map": ""}, "map: string should have at least 1 character"),
        ({"watchdog": 1}, "leave out watchdog: vehicles of VDA 5050 have none"),
        ({"robots": ["Lisa's"]}, 'robot "Lisa\'s" is no serial number'),
        ({"vehicles": {"z": {"serial": "1"}}}, "vehicles names robot z, which there is not"),
        ({"vehicles": {"a": {"serial": "2"}}}, "two robots have one manufacturer and serial"),
        ({"vehicles": {"a": {"serial": "Ä"}}}, "vehicles.a.serial: string should match"),
    ],
)
def test_a_mistake_is_found_before_a_broker_is_looked_for(
    tmp_path: Path, more: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        fleet_named(str(written(tmp_path, **more)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("line", ["map: 0017", "vehicles: {a: {serial: 0017}}", "robots: [0017]"])
def test_a_serial_number_is_not_read_as_another_number(tmp_path: Path, line: str) -> None:
    path = written(tmp_path, **{line.partition(":")[0]: None})
    plain = path.read_text()
    path.write_text(plain + line)
    with pytest.raises(InputError, match="0017, which YAML reads as the number 15; put it in q"):
        described_as(Vda5050Settings, path)
    path.write_text(plain + line.replace("0017", '"0017"'))
    found = described_as(Vda5050Settings, path)
    assert "0017" in (found.map, *(name for robot in found.robots for name in found.named(robot)))


def test_a_name_alone_does_not_do() -> None:
    with pytest.raises(InputError, match=r"The fleet 'vda5050' is described by a file"):
        fleet_named("vda5050")
