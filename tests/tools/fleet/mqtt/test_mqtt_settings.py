"""The file of robots on MQTT: every mistake is told, and its schema says the same."""

import json
import math
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from formup.tools.errors import InputError
from formup.tools.fleet.described import described_as, fleet_named, schema
from formup.tools.fleet.mqtt.settings import MqttSettings
from formup.tools.fleet.wire.frame import RobotFrame
from hypothesis import given
from hypothesis import strategies as st

ROOT = Path(__file__).parents[4]
USUAL: dict[str, Any] = {
    "fleet": "mqtt",
    "broker": "mqtt://localhost",
    "robots": ["a", 2],
    "speed": 1,
    "radius": 1,
    "tracking_error": 1,
}
COORDINATE = st.floats(-1e4, 1e4)


def written(folder: Path, **more: Any) -> Path:
    path = folder / "lab.yaml"
    given = {key: value for key, value in {**USUAL, **more}.items() if value is not None}
    path.write_text(yaml.safe_dump(given))
    return path


def test_what_a_file_leaves_out_is_usual(tmp_path: Path) -> None:
    found = described_as(MqttSettings, written(tmp_path))
    assert found.robots == ("a", "2")
    assert found.address == ("localhost", 1883, False)
    assert found.frame.to_picture(3, 4) == (3, 4)
    assert described_as(MqttSettings, written(tmp_path, broker="mqtts://h:99")).address == (
        "h",
        99,
        True,
    )


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"broker": None}, "broker: field required"),
        ({"broker": "localhost:1883"}, "give mqtt://HOST:PORT"),
        ({"broker": "mqtt://h:port"}, "broker: .*could not be cast"),
        ({"broker": "mqtt://me:secret@h"}, "set FORMUP_MQTT_USERNAME"),
        ({"broker": "mqtt://h:0"}, "broker: a port is 1 to 65535, got 0"),
        ({"robots": []}, "name 1 to 1000 robots"),
        ({"robots": ["a", "a"]}, "robot a is named twice"),
        ({"robots": ["a/b"]}, "robots.0: string should match"),
        ({"robots": ["#"]}, "robots.0: string should match"),
        ({"speed": 0}, "speed: input should be greater than 0, got 0"),
        ({"speed": math.nan}, "speed: input should be a finite number"),
        ({"wings": 2}, "wings: no such key"),
        ({"topics": {"pose": "poses"}}, "topics: .*one level of 'poses' has to be"),
        ({"topics": {"goal": "x{robot}/goal"}}, "topics: .*one level of"),
        ({"topics": {"hold": "{robot}/hold"}}, "three topics"),
        ({"topics": {"pose": "+/{robot}"}}, "topics.pose: string should match"),
        ({"period": 0.2}, "three periods or more"),
        ({"simulated": {"starts": [[1, 2]]}}, "one place for each robot"),
        ({"simulated": {"stuck": [{"robot": "c"}]}}, "simulated names robot c"),
        ({"frame": {"metres_per_pixel": 0}}, "frame.metres_per_pixel: input should be greater"),
    ],
)
def test_a_mistake_is_found_before_a_broker_is_looked_for(
    tmp_path: Path, more: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        fleet_named(str(written(tmp_path, **more)))
    assert "\n" not in str(caught.value)
    assert "secret" not in str(caught.value)


def test_a_name_alone_and_a_file_of_another_fleet_do_not_do() -> None:
    with pytest.raises(InputError, match=r"described by a file; give FILE\.yaml as the fleet"):
        fleet_named("mqtt")
    with pytest.raises(InputError, match="begin it with `fleet: mqtt`"):
        described_as(MqttSettings, ROOT / "examples/hamsters.yaml")


@given(
    x=COORDINATE,
    y=COORDINATE,
    turn=st.floats(-360, 360),
    scale=st.floats(0.001, 10),
    up=st.sampled_from(["up", "down"]),
)
def test_what_is_sent_is_where_it_is_meant(
    x: float, y: float, turn: float, scale: float, up: Any
) -> None:
    frame = RobotFrame(metres_per_pixel=scale, origin=(30, -7), turn=turn, y=up)
    assert frame.to_picture(*frame.to_robots(x, y)) == pytest.approx((x, y), abs=1e-6)
    # A step along a heading in the robots' frame is one along the same heading in the picture.
    there, ahead = frame.to_picture(1, 2), frame.to_picture(1 + math.cos(0.3), 2 + math.sin(0.3))
    way = math.atan2(ahead[1] - there[1], ahead[0] - there[0])
    assert math.remainder(way - frame.turned(0.3), math.tau) == pytest.approx(0, abs=1e-6)


def test_the_origin_and_up_are_where_they_should_be() -> None:
    frame = RobotFrame(metres_per_pixel=0.01, origin=(50, 400))
    assert frame.to_picture(1, 2) == pytest.approx((150, 200))


def test_the_schema_that_is_published_is_this_one_and_takes_the_examples() -> None:
    published = json.loads((ROOT / "docs/fleet.schema.json").read_text("utf-8"))
    assert published == schema()
    validator = jsonschema.Draft202012Validator(published)
    for name in ("hamsters", "moving", "lab", "ros", "warehouse"):
        validator.validate(yaml.safe_load((ROOT / f"examples/{name}.yaml").read_text("utf-8")))
        fleet_named(str(ROOT / f"examples/{name}.yaml"))
    assert not validator.is_valid({**USUAL, "wings": 2})
    assert not validator.is_valid({**USUAL, "fleet": "simulated"})
