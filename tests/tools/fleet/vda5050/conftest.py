"""Vehicles that are simulated on the wire of a real broker, and files of both."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from deploying import Simulated, ended, wait_for
from formup.tools.fleet.described import described_as
from formup.tools.fleet.mqtt.link import Link
from formup.tools.fleet.vda5050.fleet import Vda5050Fleet
from formup.tools.fleet.vda5050.settings import Vda5050Settings
from formup.tools.fleet.vda5050.stand_in import Vda5050StandIns

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


class Hall(Simulated[Faulty]):
    """A fleet of vehicles, and whatever speaks beside it."""

    def __init__(self, path: Path, broker: Any, more: dict[str, Any]) -> None:
        given = {**USUAL, "interface": path.parent.name, "broker": broker.url, **more}
        super().__init__(path, given)
        self.settings: Vda5050Settings = described_as(Vda5050Settings, path)
        self._links: list[Link] = []

    def simulate(self) -> "Hall":
        robots = Faulty(self.settings, self.told.append)
        links = robots._links.values()  # pyright: ignore[reportPrivateUsage]
        self.run(robots, lambda: all(link.connected for link in links))
        return self

    def fleet(self) -> Vda5050Fleet:
        return Vda5050Fleet(self.settings)

    def link(self, *topics: str, heard: Callable[[str, bytes], None] | None = None) -> Link:
        link = Link(self.settings.address, topics, heard or (lambda topic, payload: None))
        self._links.append(link.start())
        wait_for(lambda: link.connected)
        return link

    def overhear(self) -> list[tuple[str, dict[str, Any]]]:
        """All messages of both sides, as they come."""
        said: list[tuple[str, dict[str, Any]]] = []
        everything = f"{self.settings.interface}/#"
        self.link(everything, heard=lambda topic, text: said.append((topic, json.loads(text))))
        return said

    def all_of(self, said: list[tuple[str, dict[str, Any]]]) -> list[tuple[str, dict[str, Any]]]:
        """What was overheard, once all that was said before now has come."""
        mark = f"{self.settings.interface}/mark"
        self.link().say(mark, {})
        wait_for(lambda: any(topic == mark for topic, _ in said))
        return [(topic, message) for topic, message in said if topic != mark]

    def end(self) -> None:
        super().end()
        for link in self._links:
            link.close()


@pytest.fixture
def hall(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Callable[..., Hall]]:
    """Makes halls; what is given is said in their file."""

    def make(broker: Any = None, **more: Any) -> Hall:
        return Hall(tmp_path / "hall.yaml", broker or request.getfixturevalue("shared"), more)

    with ended(make) as made:
        yield made
