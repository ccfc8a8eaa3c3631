"""Robots that are simulated on the wire of a real broker, and files of both."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from deploying import Simulated, ended, wait_for
from formup.tools.fleet.described import described_as
from formup.tools.fleet.mqtt.fleet import MqttFleet
from formup.tools.fleet.mqtt.link import Link
from formup.tools.fleet.mqtt.settings import MqttSettings
from formup.tools.fleet.mqtt.stand_in import MqttStandIns

USUAL: dict[str, Any] = {
    "fleet": "mqtt",
    "robots": ["a", "b", "c"],
    "speed": 100,
    "radius": 5,
    "tracking_error": 2,
    "simulated": {"starts": [[50, 50], [50, 100], [50, 150]]},
}


class Faulty(MqttStandIns):
    """Stand-ins of which some do what they should not, from when their ids are put in here."""

    def __init__(self, settings: MqttSettings, told: Callable[[str], None]) -> None:
        self.faults: dict[str, Callable[[dict[str, Any], int], dict[str, Any] | None]] = {}
        self.runaway = set[str]()
        super().__init__(settings, told)
        self.seq = 1_000

    def step(self) -> None:
        for i, robot in enumerate(self.robots):
            self._sim.points[i] += (5 * (robot in self.runaway), 0)
        super().step()

    def reboot(self) -> None:
        self.seq = 0

    def _message(self, robot: str, place: tuple[float, float]) -> dict[str, Any] | None:
        message = super()._message(robot, place)
        if message is None or robot not in self.faults:
            return message
        return self.faults[robot](message, self.seq)


class Lab(Simulated[Faulty]):
    """A fleet on MQTT, and whatever speaks beside it."""

    def __init__(self, path: Path, broker: Any, more: dict[str, Any]) -> None:
        own = path.parent.name
        topics = {
            "pose": f"{own}/{{robot}}/pose",
            "goal": f"{own}/{{robot}}/goal",
            "hold": f"{own}/hold",
        }
        super().__init__(path, {**USUAL, "broker": broker.url, "topics": topics, **more})
        self.settings: MqttSettings = described_as(MqttSettings, path)
        self._links: list[Link] = []

    def simulate(self) -> "Lab":
        robots = Faulty(self.settings, self.told.append)
        self.run(robots, lambda: robots.link.connected)
        return self

    def fleet(self) -> MqttFleet:
        return MqttFleet(self.settings)

    def link(self, *topics: str, heard: Callable[[str, bytes], None] | None = None) -> Link:
        link = Link(self.settings.address, topics, heard or (lambda topic, payload: None))
        self._links.append(link.start())
        wait_for(lambda: link.connected)
        return link

    def topic(self, kind: str, robot: str = "") -> str:
        return str(getattr(self.settings.topics, kind)).replace("{robot}", robot)

    def end(self) -> None:
        super().end()
        for link in self._links:
            link.close()


@pytest.fixture
def lab(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Callable[..., Lab]]:
    """Makes labs; what is given is said in their file."""

    def make(broker: Any = None, **more: Any) -> Lab:
        return Lab(tmp_path / "lab.yaml", broker or request.getfixturevalue("shared"), more)

    with ended(make) as made:
        yield made


def spoken(**message: Any) -> bytes:
    return json.dumps(message).encode()
