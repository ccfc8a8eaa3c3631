"""The load an MQTT broker carries when all robots drive at once: messages lost, and latency.

There are three processes: mosquitto, the robots, and the fleet that drives them, all at QoS 0.
`python -m formup.benchmarks.bench_mqtt [ROBOTS [SECONDS]]`
"""

import asyncio
import json
import multiprocessing
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np

from ..tools.errors import FleetError
from ..tools.fleet.mqtt.fleet import MqttFleet
from ..tools.fleet.mqtt.settings import MqttSettings
from ..tools.fleet.mqtt.stand_in import MqttStandIns
from ..tools.fleet.protocol import Pose, points_of
from ..tools.motion.motion import Motion

SPEED = 100.0
BROKER = "allow_anonymous true\nset_tcp_nodelay true\n"


class Counted:
    """Sequence numbers of messages by robot, to find those lost, and the latencies in seconds."""

    def __init__(self) -> None:
        self._seqs: dict[str, list[int]] = defaultdict(list)
        self.late: list[float] = []

    def note(self, topic: str, payload: bytes) -> None:
        """Record one message."""
        message: dict[str, Any] = json.loads(payload)
        if "seq" in message:
            self._seqs[topic].append(message["seq"])
            self.late.append(time.monotonic() - message.get("sent", 0.0))

    def counts(self) -> tuple[int, int]:
        """Return the messages received, and those missing between each robot's first and last."""
        wanted = sum(max(s) - min(s) + 1 for s in self._seqs.values())
        came = sum(len(set(s)) for s in self._seqs.values())
        return came, wanted - came


class Robots(MqttStandIns):
    """Stand-ins that time-stamp what they send, and count what they receive."""

    def __init__(self, settings: MqttSettings) -> None:
        self.counted = Counted()
        super().__init__(settings, lambda text: None)

    def _message(self, robot: str, place: tuple[float, float]) -> dict[str, Any] | None:
        message = super()._message(robot, place)
        return message and message | {"sent": time.monotonic()}

    def _heard(self, topic: str, payload: bytes) -> None:
        self.counted.note(topic, payload)
        super()._heard(topic, payload)


class Driver(MqttFleet):
    """A fleet that counts what it receives."""

    def __init__(self, settings: MqttSettings) -> None:
        self.counted = Counted()
        super().__init__(settings)

    def _heard(self, topic: str, payload: bytes) -> None:
        self.counted.note(topic, payload)
        super()._heard(topic, payload)


def main(robots: int = 100, seconds: float = 60.0) -> None:
    """Print how many messages came, how many were lost, and their latency."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    ids = tuple(f"r{i}" for i in range(robots))
    starts = tuple((20.0, 20.0 * i) for i in range(robots))
    settings = MqttSettings.model_validate(
        {
            "broker": f"mqtt://127.0.0.1:{port}",
            "robots": ids,
            "speed": SPEED,
            "radius": 5.0,
            "tracking_error": 2.0,
            "pose_timeout": 5.0,
            "watchdog": 5.0,
            "simulated": {"starts": starts},
        }
    )
    found = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if found is None:
        print("mosquitto is not installed: not measured")  # noqa: T201
        return
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "mosquitto.conf"
        config.write_text(f"listener {port} 127.0.0.1\n{BROKER}")
        broker = subprocess.Popen([found, "-c", str(config)], stderr=subprocess.DEVNULL)
        try:
            _measured(settings, seconds)
        finally:
            broker.terminate()
            broker.wait()


def _measured(settings: MqttSettings, seconds: float) -> None:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    done = context.Event()
    process = context.Process(target=_stand_in, args=(settings, done, theirs))
    process.start()
    fleet = Driver(settings)
    sent, took, share = asyncio.run(_drive(fleet, seconds))
    done.set()
    goals, missed = ours.recv()
    process.join()
    came, lost = fleet.counted.counts()
    late = 1000 * np.array(fleet.counted.late)
    p50, p99 = np.percentile(late, [50, 99])
    ids = len(settings.robots)
    print(f"{ids} robots drove for {took:.0f} s, QoS 0; the fleet took {share:.0%} of a core")  # noqa: T201
    print(f"poses: {came} came ({len(late) / took / ids:.1f} a second of each), {lost} were lost")  # noqa: T201
    print(f"goals: {goals} came ({sent / took:.1f} a second to each), {missed} were lost")  # noqa: T201
    print(f"poses came after {p50:.1f} ms (median), {p99:.1f} ms (p99), {late.max():.1f} ms (most)")  # noqa: T201


async def _drive(fleet: Driver, seconds: float) -> tuple[int, float, float]:
    """Drive the fleet; return how often goals were sent, in how many seconds, at what CPU share."""
    poses: tuple[Pose, ...] = ()
    while not poses:
        with suppress(FleetError):  # the robots are still connecting to the broker
            poses = await fleet.observe()
    points = points_of(poses)
    ends = points + np.array([SPEED * seconds, 0.0])
    ways = zip(poses, points, ends, strict=True)
    motion = Motion({pose.id: np.stack([start, end]) for pose, start, end in ways})
    fleet.counted.late.clear()
    begun, busy, sent = time.monotonic(), time.process_time(), 0
    async for _ in fleet.drive(motion):
        sent += 1
    took, busy = time.monotonic() - begun, time.process_time() - busy
    await fleet.close()
    return sent, took, busy / took


def _stand_in(settings: MqttSettings, done: Event, results: Connection) -> None:
    robots = Robots(settings)
    robots.run(done.is_set)
    results.send(robots.counted.counts())
    robots.close()


if __name__ == "__main__":
    given = sys.argv[1:]
    main(int(given[0]) if given else 100, float(given[1]) if len(given) > 1 else 60.0)
