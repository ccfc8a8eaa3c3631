"""The file of robots that run ROS: every mistake is told, before a bridge is looked for."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from formup.tools.errors import InputError
from formup.tools.fleet.described import described_as, fleet_named
from formup.tools.fleet.protocol import FleetRequest
from formup.tools.fleet.ros.fleet import RosFleet
from formup.tools.fleet.ros.settings import RosSettings

USUAL: dict[str, Any] = {
    "fleet": "ros",
    "bridge": "ws://localhost",
    "robots": ["a", "b2"],
    "speed": 1,
    "radius": 1,
    "tracking_error": 1,
    "frame": {"metres_per_pixel": 0.01},
}


def written(folder: Path, **more: Any) -> Path:
    path = folder / "ros.yaml"
    given = {key: value for key, value in {**USUAL, **more}.items() if value is not None}
    path.write_text(yaml.safe_dump(given))
    return path


def test_what_a_file_leaves_out_is_usual(tmp_path: Path) -> None:
    found = described_as(RosSettings, written(tmp_path))
    assert (found.address, found.url) == (("localhost", 9090), "ws://localhost:9090")
    assert found.poses == {"/a/pose": "a", "/b2/pose": "b2"}
    assert found.goals == {"/a/goal_pose": "a", "/b2/goal_pose": "b2"}
    assert found.frame.to_picture(1, 1) == (100, -100)
    found = described_as(RosSettings, written(tmp_path, bridge="wss://h:1/x", drive_by="nav2"))
    assert (found.url, next(iter(found.goals))) == ("wss://h:1/x", "/a/navigate_to_pose")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"bridge": None}, "bridge: field required"),
        ({"bridge": "localhost:9090"}, "give ws://HOST:PORT, or wss:// for TLS"),
        ({"bridge": "ws://me:secret@h"}, "leave out who logs in"),
        ({"bridge": "ws://h:0"}, "a port is 1 to 65535, got 0"),
        ({"bridge": "ws://h:port"}, "bridge: .*could not be cast"),
        ({"frame": None}, "say in `frame` how the map lies in the picture"),
        ({"robots": ["a-b"]}, "'/a-b/pose' is no name of ROS"),
        ({"robots": ["1"]}, "'/1/pose' is no name of ROS"),
        ({"topics": {"pose": "/pose"}}, "topics have to differ"),
        ({"topics": {"pose": "{robot}/pose"}}, "'a/pose' is no name of ROS"),
        ({"topics": {"goal": "/{robot}/pose"}}, "topics have to differ"),
        ({"pose_type": "geometry_msgs/Pose"}, "pose_type: string should match"),
        ({"drive_by": "wire"}, "drive_by: input should be 'pose', 'cmd_vel' or 'nav2'"),
        ({"turn_speed": 0}, "turn_speed: input should be greater than 0"),
    ],
)
def test_a_mistake_is_told(tmp_path: Path, more: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        fleet_named(str(written(tmp_path, **more)))
    assert "\n" not in str(caught.value)
    assert "secret" not in str(caught.value)


def test_without_the_library_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "websockets.asyncio.client", None)
    with pytest.raises(InputError, match=r"pip install 'formup\[ros\]'"):
        fleet_named(str(written(tmp_path)))(FleetRequest((640, 480), 2))


def test_the_name_opens_it(tmp_path: Path) -> None:
    pytest.importorskip("websockets", reason="the extra ros is not installed")
    fleet = fleet_named(str(written(tmp_path)))(FleetRequest((640, 480), 2))
    assert isinstance(fleet, RosFleet)
    fleet.link.close()
