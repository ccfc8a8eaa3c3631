"""Vehicles that are simulated on the wire of a real broker, and files of both."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from formup.tools.fleet.described import described_as
from formup.tools.fleet.mqtt.link import Link
from formup.tools.fleet.vda5050.fleet import Vda5050Fleet
from formup.tools.fleet.vda5050.settings import Vda5050Settings
from formup.tools.fleet.vda5050.stand_in import Vda5050StandIns

PATIENCE = 10.0
USUAL: dict[str, Any] = {
    "fleet": "vda5050",
    "version": "2.1",
    "manufacturer": "KIT",
    "map": "hall",
    "robots": ["a", "b", "c"],
    "speed": 200,
    "radius": 5,
    "tracking_error": 4,
    "pose_timeout": 1.0,
    "simulated": {"starts": [[50, 50], [50, 100], [50, 150]]},
}
Fault = Callable[[str, dict[str, Any]], dict[str, Any] | None]


def wait_for(what: Callable[[], object]) -> None:
    ends = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < ends, "it has not come about"
        time.sleep(0.01)


class Faulty(Vda5050StandIns):
    """Stand-ins of which some say what they should not, from when their ids are put in here."""

    def __init__(self, settings: Vda5050Settings, told: Callable[[str], None]) -> None:
        self.faults: dict[str, Fault] = {}
        super().__init__(settings, told)

    def _message(self, robot: str, kind: str, body: dict[str, Any]) -> None:
        message = self._writer.message(robot, kind, body)
        fault = self.faults.get(robot, lambda kind, message: message)
        said = fault(kind, message)
        if said is not None:
            self._links[robot].say(self._speaks.topic(robot, kind), said)


class Hall:
    """A fleet's file, its stand-ins in a thread, and whatever speaks beside them."""

    def __init__(self, path: Path, broker: Any, more: dict[str, Any]) -> None:
        given = {**USUAL, "interface": path.parent.name, "broker": broker.url, **more}
        path.write_text(yaml.safe_dump(given))
        self.path, self.told = path, list[str]()
        self.settings: Vda5050Settings = described_as(Vda5050Settings, path)
        self._done = threading.Event()
        self._robots: Faulty | None = None
        self._thread: threading.Thread | None = None
        self._links: list[Link] = []

    @property
    def robots(self) -> Faulty:
        assert self._robots is not None
        return self._robots

    def simulate(self) -> "Hall":
        self._robots = Faulty(self.settings, self.told.append)
        wait_for(lambda: all(link.connected for link in self.robots._links.values()))  # pyright: ignore[reportPrivateUsage]
        self._thread = threading.Thread(target=self.robots.run, args=(self._done.is_set,))
        self._thread.start()
        return self

    def fleet(self) -> Vda5050Fleet:
        return Vda5050Fleet(self.settings)

    def link(self, *topics: str, heard: Callable[[str, bytes], None] | None = None) -> Link:
        link = Link(self.settings.address, topics, heard or (lambda topic, payload: None))
        self._links.append(link)
        wait_for(lambda: link.connected)
        return link

    def overhear(self) -> list[tuple[str, dict[str, Any]]]:
        """All messages of both sides, as they come."""
        said: list[tuple[str, dict[str, Any]]] = []
        everything = f"{self.settings.interface}/#"
        self.link(everything, heard=lambda topic, text: said.append((topic, json.loads(text))))
        return said

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
def hall(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Callable[..., Hall]]:
    """Makes halls; what is given is said in their file."""
    made: list[Hall] = []

    def make(broker: Any = None, **more: Any) -> Hall:
        found = broker or request.getfixturevalue("shared")
        made.append(Hall(tmp_path / "hall.yaml", found, more))
        return made[-1]

    yield make
    for one in made:
        one.end()
