"""A stand-in bridge on a free port, robots that stand in behind it, and files of both."""

import json
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from deploying import Simulated, ended
from formup.tools.fleet.described import described_as
from formup.tools.fleet.ros.bridge import StandInBridge
from formup.tools.fleet.ros.fleet import RosFleet
from formup.tools.fleet.ros.settings import RosSettings
from formup.tools.fleet.ros.stand_in import RosStandIns

USUAL: dict[str, Any] = {
    "fleet": "ros",
    "robots": ["a", "b", "c"],
    "speed": 100,
    "radius": 5,
    "tracking_error": 2,
    "frame": {"y": "down"},
    "turn_speed": 4,
    "simulated": {"starts": [[50, 50], [50, 100], [50, 150]]},
}


class Faulty(RosStandIns):
    """Stand-ins of which some do what they should not, from when their ids are put in here."""

    def __init__(self, settings: RosSettings, told: Callable[[str], None]) -> None:
        self.faults: dict[str, Callable[[dict[str, Any], int], dict[str, Any] | None]] = {}
        self._reboots = False
        self.heard: list[Mapping[str, Any]] = []
        super().__init__(settings, told)
        self.seq = 1_000

    def step(self) -> None:
        if self._reboots:  # all at once
            self._reboots, self.seq = False, 0
        super().step()

    def reboot(self) -> None:
        self._reboots = True

    def restart_bridge(self) -> None:
        self.link = self._bridge = StandInBridge(self._ros.address, self._heard)
        self._bridge.start()

    def result(self, status: int) -> None:
        robot, (goal, action) = next(iter(self._acting.items()))
        self.robots[robot].goal = None
        self._result(robot, goal, action, status)

    def _heard(self, message: Mapping[str, Any]) -> None:
        self.heard.append(message)
        super()._heard(message)

    def _message(self, robot: str, place: tuple[float, float]) -> dict[str, Any] | None:
        message = super()._message(robot, place)
        if message is None or robot not in self.faults:
            return message
        return self.faults[robot](message, self.seq)


class Lab(Simulated[Faulty]):
    """A fleet behind a stand-in bridge, and whatever speaks beside it."""

    def __init__(self, path: Path, more: dict[str, Any]) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port: int = free.getsockname()[1]
        given = {**USUAL, "bridge": f"ws://127.0.0.1:{port}", **more}
        super().__init__(path, {key: what for key, what in given.items() if what is not None})
        self.settings: RosSettings = described_as(RosSettings, path)
        self._speaking: threading.Thread | None = None

    def simulate(self) -> "Lab":
        self.run(Faulty(self.settings, self.told.append), lambda: True)
        return self

    def fleet(self) -> RosFleet:
        return RosFleet(self.settings)

    def say(self, topic: str, message: dict[str, Any]) -> None:
        """Somebody else publishes something, again and again."""
        from websockets.sync.client import connect

        def again() -> None:
            with connect(self.settings.url, proxy=None) as socket:
                for _ in range(60):
                    socket.send(json.dumps({"op": "publish", "topic": topic, "msg": message}))
                    self.done.wait(0.05)

        self._speaking = threading.Thread(target=again)
        self._speaking.start()

    def goal(self, robot: str) -> str:
        return {robot: topic for topic, robot in self.settings.goals.items()}[robot]

    def end(self) -> None:
        self.done.set()
        if self._speaking is not None:
            self._speaking.join()
        super().end()


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Callable[..., Lab]]:
    """Makes labs; what is given is said in their file."""
    pytest.importorskip("websockets", reason="the extra ros is not installed")

    def make(**more: Any) -> Lab:
        return Lab(tmp_path / "lab.yaml", more)

    with ended(make) as made:
        yield made
