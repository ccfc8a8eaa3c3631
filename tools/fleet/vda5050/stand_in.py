"""Stand-ins for vehicles that speak VDA 5050: each with a connection and a last will of its own."""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..mqtt.link import Link
from ..wire.fleet import Point
from ..wire.stand_in import StandIns
from .messages import Writer, read
from .settings import Vda5050Settings
from .vehicle import Vehicle

EVERY = 2
"""They say where they are at every so many steps, ten times a second,"""
STATES = 1.0
"""and their state when it changes, and every so many seconds."""
STANDS = 1e-6


class Vda5050StandIns(StandIns):
    """Simulated vehicles that speak VDA 5050; see `StandIns`.

    Attributes:
        vehicles: what each knows, by id.
    """

    def __init__(self, settings: Vda5050Settings, told: Callable[[str], None]) -> None:
        super().__init__(settings, told)
        self._speaks, self._lock = settings, threading.RLock()
        self._writer, self._before = Writer(settings), self.points.copy()
        self.vehicles = {robot: Vehicle(settings) for robot in self.robots}
        self._said: dict[str, tuple[dict[str, Any], float]] = {}
        self._joined = dict.fromkeys(self.robots, 0)
        self._links = {robot: self._linked(robot) for robot in self.robots}
        self.link = self._links[settings.robots[0]]
        for link in self._links.values():
            link.start()

    def step(self) -> None:
        """Let a step of time pass: vehicles go on, and say what is due."""
        moved = np.linalg.norm(self.points - self._before, axis=1)
        self._before = self.points.copy()
        with self._lock:
            for i, (name, robot) in enumerate(self.robots.items()):
                place = self._settings.frame.to_robots(*self._sim.sensed[i].tolist())
                vehicle = self.vehicles[name]
                vehicle.heading = round(self.heading(name) or 0.0, 5)
                goal, look = vehicle.go_on(place, bool(moved[i] > STANDS)), vehicle.look
                if (goal is None) != (robot.goal is None):
                    self._changes["standing" if goal is None else "driving"].append(name)
                robot.goal = None if goal is None else self._settings.frame.to_picture(*goal)
                robot.look = None if look is None else self._settings.frame.turned(look)
                robot.said = time.monotonic()  # what one was told holds, however long ago
            super().step()

    def say(self, robot: str, place: Point) -> None:
        """Say where a vehicle is seen, and its state; see `StandIns.say`."""
        link, vehicle, now = self._links[robot], self.vehicles[robot], time.monotonic()
        if link.joined != self._joined[robot]:
            self._joined[robot] = link.joined
            self._connection(robot, "ONLINE")
        state, (before, when) = vehicle.state(), self._said.get(robot, ({}, 0.0))
        if state != before or now - when >= STATES:
            self._said[robot] = state, now
            self._message(robot, "state", state | vehicle.position())
        if self.seq % EVERY == 0:
            after = self._speaks.dialect.reference(self._writer.last(robot, "state"))
            self._message(robot, "visualization", vehicle.position() | after)

    def close(self) -> None:
        """Leave the wire, and say so."""
        for robot, link in self._links.items():
            self._connection(robot, "OFFLINE")
            link.close()

    def _message(self, robot: str, kind: str, body: dict[str, Any]) -> None:
        message = self._writer.message(robot, kind, body)
        self._links[robot].say(self._speaks.topic(robot, kind), message)

    def _connection(self, robot: str, state: str) -> None:
        message = self._writer.message(robot, "connection", {"connectionState": state})
        topic = self._speaks.topic(robot, "connection")
        self._links[robot].say(topic, message, surely=True, kept=True)

    def _linked(self, robot: str) -> Link:
        settings = self._speaks
        broken = {"connectionState": settings.dialect.broken}
        will = self._writer.message(robot, "connection", broken)
        listened = [settings.topic(robot, kind) for kind in ("order", "instantActions")]
        gone = settings.topic(robot, "connection"), will, True

        def heard(topic: str, payload: bytes) -> None:
            self._heard(robot, topic.rpartition("/")[2], payload)

        return Link(settings.address, listened, heard, will=gone)

    def _heard(self, robot: str, kind: str, payload: bytes) -> None:
        message, vehicle = read(self._speaks.version, kind, payload), self.vehicles[robot]
        with self._lock:
            if kind == "order":
                vehicle.take(message)
            for action in (message or {}).get("actions", []):
                vehicle.act(action)
                if action["actionType"] == "stateRequest":
                    self._said.pop(robot, None)
