"""Robots that are simulated on the wire of a real broker, and files of both."""

import json
import sys
import threading
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml
from formup.tools.fleet.described import described_as
from formup.tools.fleet.mqtt.fleet import MqttFleet
from formup.tools.fleet.mqtt.link import Link
from formup.tools.fleet.mqtt.settings import MqttSettings
from formup.tools.fleet.mqtt.stand_in import MqttStandIns

sys.path.insert(0, str(Path(__file__).parents[1]))
wait_for = import_module("deploying").wait_for
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


class Lab:
    """A fleet's file, its stand-ins in a thread, and whatever speaks beside them."""

    def __init__(self, path: Path, broker: Any, more: dict[str, Any]) -> None:
        own = path.parent.name
        topics = {
            "pose": f"{own}/{{robot}}/pose",
            "goal": f"{own}/{{robot}}/goal",
            "hold": f"{own}/hold",
        }
        given = {**USUAL, "broker": broker.url, "topics": topics, **more}
        path.write_text(yaml.safe_dump(given))
        self.path, self.told = path, list[str]()
        self.settings: MqttSettings = described_as(MqttSettings, path)
        self._done = threading.Event()
        self._robots: Faulty | None = None
        self._thread: threading.Thread | None = None
        self._links: list[Link] = []

    @property
    def robots(self) -> Faulty:
        assert self._robots is not None
        return self._robots

    def simulate(self) -> "Lab":
        self._robots = Faulty(self.settings, self.told.append)
        wait_for(lambda: self.robots.link.connected)
        self._thread = threading.Thread(target=self.robots.run, args=(self._done.is_set,))
        self._thread.start()
        return self

    def fleet(self) -> MqttFleet:
        return MqttFleet(self.settings)

    def link(self, *topics: str, heard: Callable[[str, bytes], None] | None = None) -> Link:
        link = Link(self.settings.address, topics, heard or (lambda topic, payload: None))
        self._links.append(link)
        wait_for(lambda: link.connected)
        return link

    def topic(self, kind: str, robot: str = "") -> str:
        return str(getattr(self.settings.topics, kind)).replace("{robot}", robot)

    def was_told(self, what: str) -> bool:
        return any(what in text for text in self.told)

    def end(self) -> None:
        self._done.set()
        if self._thread is not None:
            self._thread.join()
        for link in self._links:
            link.close()
        if self._robots is not None:
            self._robots.close()


@pytest.fixture
def lab(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Callable[..., Lab]]:
    """Makes labs; what is given is said in their file."""
    made: list[Lab] = []

    def make(broker: Any = None, **more: Any) -> Lab:
        found = broker or request.getfixturevalue("shared")
        made.append(Lab(tmp_path / "lab.yaml", found, more))
        return made[-1]

    yield make
    for one in made:
        one.end()


def spoken(**message: Any) -> bytes:
    return json.dumps(message).encode()
