"""The fleet of vehicles that speak VDA 5050.

There is no last will: a broker has one message for each connection, and a vehicle is told by one
of its own. Vehicles end at the last node that was released to them, half a second ahead at most.
"""

import asyncio
import threading
import time
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..described import described_for
from ..mqtt.link import Link
from ..protocol import FleetRequest
from ..wire.fleet import HOLDING, Point, Reason, WireFleet
from ..wire.poses import PoseMessage
from .hearing import KINDS, Hearing
from .messages import Writer, action, read
from .orders import AGAIN, TAKEN, Order
from .settings import Vda5050Settings

PAUSE, GO_ON, CANCEL = "startPause", "stopPause", "cancelOrder"
ENDED = ("FINISHED", "FAILED")
OF_MASTERS = ("order", "instantActions")
"""What those say who drive; we do not hear ourselves."""


@dataclass
class Instant:
    """Actions that a vehicle was told to do at once.

    Attributes:
        actions: as they were sent.
        begun, due: when it was told, and is to be told again, as it may not have heard.
    """

    actions: list[dict[str, Any]]
    begun: float
    due: float


class Vda5050Fleet(WireFleet):
    """Vehicles that speak VDA 5050, as a file describes them."""

    name = "vda5050"

    def __init__(self, settings: Vda5050Settings) -> None:
        super().__init__(settings)
        self._settings, self._lock = settings, threading.RLock()
        self._writer = Writer(settings)
        self._hearing = Hearing(settings, self.poses, self._ask)
        self._orders: dict[str, Order] = {}
        self._instant: dict[str, Instant] = {}
        listened = [settings.topic("+", kind) for kind in (*KINDS, *OF_MASTERS)]
        self.link = self._link = Link(settings.address, listened, self._heard, left=self._left)
        self.begin(self._judged)

    def send(
        self, drive: str, seq: int, goals: Mapping[str, Point], looks: Mapping[str, float]
    ) -> None:
        """Take robots further along their orders; see `WireFleet.send`."""
        now = time.monotonic()
        with self._lock:
            for robot, goal in goals.items():
                vehicle, pose = self._hearing.vehicles[robot], self.poses.tracks[robot].pose
                if pose is None or vehicle.state is None or self._still_busy(robot, now):
                    continue
                order = self._orders.get(robot)
                if order is None or order.name != drive:
                    start = self._settings.frame.to_robots(pose.x, pose.y)
                    order = Order(self._settings, drive, start, vehicle.state)
                    self._orders[robot], vehicle.order = order, None
                order.go_on(goal, now, looks.get(robot))
                if message := order.message(now):
                    self._say(robot, "order", message)

    def hold(self, reason: Reason) -> None:
        """Cancel the orders of robots; those that a person stops pause before, to stand at once.

        The pause is lifted when there is no order left: it would outlast this process.
        """
        with self._lock:
            for robot, vehicle in self._hearing.vehicles.items():
                order, state = self._orders.pop(robot, None), vehicle.state or {}
                vehicle.order = None
                stopped = reason == "stop" and (not state or bool(state["nodeStates"]))
                stopped = stopped and not self._pausing(robot)  # which is told until it is heard
                if stopped or (order is not None and not (state and order.done(state))):
                    self._tell(robot, [PAUSE, CANCEL] if reason == "stop" else [CANCEL])

    async def release(self) -> None:
        """Lift the stop, and pauses that are left; orders stay cancelled."""
        await super().release()
        with self._lock:
            for robot, vehicle in self._hearing.vehicles.items():
                told, state = robot in self._instant, vehicle.state or {}
                if told or state.get("paused"):
                    has_order = told or state.get("nodeStates")
                    self._tell(robot, [CANCEL, GO_ON] if has_order else [GO_ON])

    async def close(self) -> None:
        """Let go of the broker, when robots have done what they were told at once."""
        ends = time.monotonic() + HOLDING
        while self._instant and self.link.connected and time.monotonic() < ends:
            await asyncio.sleep(self.settings.period)
        await super().close()

    def _tell(self, robot: str, kinds: list[str]) -> None:
        """Have a vehicle do actions at once; it is told again until it says that it heard."""
        now = time.monotonic()
        actions = [action(kind, uuid.uuid4().hex) for kind in kinds]
        self._instant[robot] = Instant(actions, now, now + AGAIN)
        self._say(robot, "instantActions", {"actions": actions})

    def _still_busy(self, robot: str, now: float) -> bool:
        """Whether a vehicle has not done yet what it was told at once: no order is due before."""
        told, state = self._instant.get(robot), self._hearing.vehicles[robot].state or {}
        if told is None:
            return False
        said = {
            act["actionId"]: act["actionStatus"]
            for act in state.get(self._settings.dialect.instant, [])
        }
        answers = [said.get(act["actionId"]) for act in told.actions]
        if all(answer in ENDED for answer in answers):
            pausing = self._pausing(robot)
            del self._instant[robot]
            if pausing:
                self._tell(robot, [GO_ON])
        elif now > told.begun + TAKEN:
            del self._instant[robot]
        elif None in answers and now >= told.due:
            told.due = now + AGAIN
            self._say(robot, "instantActions", {"actions": told.actions})
        return robot in self._instant

    def _pausing(self, robot: str) -> bool:
        told = self._instant.get(robot)
        return told is not None and told.actions[0]["actionType"] == PAUSE

    def _heard_another(self, topic: str, payload: bytes) -> None:
        """Note what another program told a vehicle: a pause is a person's stop."""
        if topic.endswith("/order"):
            self.saw_others()
            return
        message = read(self._settings.version, "instantActions", payload) or {"actions": []}
        if any(act["actionType"] == PAUSE for act in message["actions"]):
            self.latch()

    def _heard(self, topic: str, payload: bytes) -> None:
        now = time.monotonic()
        with self._lock:
            if topic.endswith(OF_MASTERS):
                if self._hearing.robot_of(topic):
                    self._heard_another(topic, payload)
                return
            robot = self._hearing.heard(topic, payload)
            if robot is None:
                return
            self._still_busy(robot, now)
            vehicle, order = self._hearing.vehicles[robot], self._orders.get(robot)
            if order is not None and vehicle.state is not None:
                vehicle.order = order.hindrance(vehicle.state, now)
                self._hearing.judge(robot)

    def _judged(self, robot: str, seen: PoseMessage) -> PoseMessage | str:
        with self._lock:
            return self._hearing.seen(robot, seen)

    def _left(self) -> None:
        """The broker is gone, and with it all that was said."""
        with self._lock:
            self._orders.clear()
            self._instant.clear()
            self._hearing.forget()

    def _ask(self, robot: str) -> None:
        self._say(robot, "instantActions", {"actions": [action("stateRequest", uuid.uuid4().hex)]})

    def _say(self, robot: str, kind: str, body: Mapping[str, Any]) -> None:
        message = self._writer.message(robot, kind, body)
        self._link.say(self._settings.topic(robot, kind), message)


def open_fleet(request: FleetRequest) -> Vda5050Fleet:
    """The vehicles of the file that was given.

    Raises:
        InputError: it does not describe such vehicles, or its camera has not seen the picture.
    """
    return Vda5050Fleet(described_for(Vda5050Settings, request))
