"""A vehicle as VDA 5050 has it, without wheels: what it does with orders and instant actions.

It knows where it is to go and says what the standard has it say; who moves it is up to others.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..wire.fleet import Point
from .settings import Vda5050Settings
from .spec import Refusal

Json = dict[str, Any]


@dataclass
class Vehicle:
    """One vehicle.

    Attributes:
        place: where it is, in its own frame.
        heading: how it looks, radians.
        driving: whether it moves.
        base: nodes that it has yet to pass, each with the edge to it.
        last: id and number of the node that it passed last.
        end: likewise of the last that was released to it.
        cancelled: whether its order was, or it was switched to manual: no more of it is taken.
        cancelling: the actions that cancel the order, until the vehicle stands.
    """

    settings: Vda5050Settings
    place: Point = (0.0, 0.0)
    heading: float = 0.0
    driving: bool = False
    order: str = ""
    update: int = 0
    base: list[tuple[Json, Json]] = field(default_factory=list[tuple[Json, Json]])
    last: tuple[str, int] = ("", 0)
    end: tuple[str, int] = ("", 0)
    cancelled: bool = False
    cancelling: list[Json] = field(default_factory=list[Json])
    paused: bool = False
    mode: str = "AUTOMATIC"
    emergency: str = "NONE"
    violated: bool = False
    localised: bool = True
    errors: list[Json] = field(default_factory=list[Json])
    actions: list[Json] = field(default_factory=list[Json])

    def take(self, message: Json | None) -> None:
        """Take an order, None if it could not be read, or say why not."""
        refusal = "malformed" if message is None else self._refusal(message)
        if refusal:
            self.complain(self.settings.dialect.refusals[refusal])
            return
        assert message is not None
        if (message["orderId"], message["orderUpdateId"]) == (self.order, self.update):
            return  # sent again
        nodes = [node for node in message["nodes"] if node["released"]]
        if message["orderId"] != self.order:
            self.base, self.last = [], _name(nodes[0])
            self.cancelled, self.order = False, message["orderId"]
        self.update, self.end, self.errors = message["orderUpdateId"], _name(nodes[-1]), []
        self.base += zip(nodes[1:], message["edges"], strict=False)

    def act(self, action: Json) -> None:
        """Do at once what one is told; what one was told before is not done twice."""
        if any(known["actionId"] == action["actionId"] for known in self.actions):
            return
        kind = action["actionType"]
        done = {"actionId": action["actionId"], "actionType": kind, "actionStatus": "FINISHED"}
        self.actions = [*self.actions, done][-20:]
        if kind in ("startPause", "stopPause"):
            self.paused = kind == "startPause"
        elif kind == "cancelOrder" and self.base:
            self.cancelling, done["actionStatus"] = [*self.cancelling, done], "RUNNING"
        elif kind != "stateRequest":
            done["actionStatus"] = "FAILED"
            if kind == "cancelOrder":
                self.complain(self.settings.dialect.idle)

    def complain(self, kind: str, level: str = "WARNING") -> None:
        """Say that there is an error, until a new order is taken."""
        error = {"errorType": kind, "errorLevel": level}
        self.errors = [*(known for known in self.errors if known != error), error]

    def go_on(self, place: Point, driving: bool) -> Point | None:
        """Note where one is and whether one moves; where to go now, None to stand."""
        self.place, self.driving = place, driving
        while self.base and not self.cancelling and self._near(self.base[0][0]):
            if len(self.base) == 1 and driving:
                break  # it comes as near to its last node as it can
            self.last = _name(self.base.pop(0)[0])
        if self.cancelling and not driving:
            for done in self.cancelling:
                done["actionStatus"] = "FINISHED"
            self.cancelling, self.cancelled, self.base = [], True, []
        if self.mode not in ("AUTOMATIC", "SEMIAUTOMATIC"):
            self.cancelled, self.base = True, []
        hindered = self.paused or self.violated or self.emergency != "NONE" or not self.localised
        if hindered or self.cancelling or not self.base:
            return None
        position = self.base[0][0]["nodePosition"]
        return position["x"], position["y"]

    @property
    def look(self) -> float | None:
        """Which way it is to look at the next node; None for any."""
        return self.base[0][0]["nodePosition"].get("theta") if self.base else None

    def state(self) -> Json:
        """What a vehicle says of itself, but for where it is."""
        dialect = self.settings.dialect
        nodes, edges = [node for node, _ in self.base], [edge for _, edge in self.base]
        found: Json = {
            "orderId": self.order,
            "orderUpdateId": self.update,
            "lastNodeId": self.last[0],
            "lastNodeSequenceId": self.last[1],
            "nodeStates": [_part(node, "nodeId") for node in nodes],
            "edgeStates": [_part(edge, "edgeId") for edge in edges],
            "driving": self.driving,
            "paused": self.paused,
            "actionStates": [],
            dialect.power: {dialect.charge: 80.0, "charging": False},
            "operatingMode": self.mode,
            "errors": self.errors,
            "safetyState": {dialect.emergency: self.emergency, "fieldViolation": self.violated},
        }
        return found | {dialect.instant: [dict(action) for action in self.actions]}

    def position(self) -> Json:
        """Where it says that it is."""
        dialect, (x, y) = self.settings.dialect, self.place
        found: Json = {
            "x": round(x, 6),
            "y": round(y, 6),
            "theta": self.heading,
            "mapId": self.settings.map,
        }
        return {dialect.position: found | {dialect.located: self.localised}}

    def _refusal(self, message: Json) -> Refusal | None:
        nodes, number, its_own = _released(message), message["orderUpdateId"], False
        its_own = bool(self.order) and message["orderId"] == self.order
        if self.mode not in ("AUTOMATIC", "SEMIAUTOMATIC"):
            return "unavailable"
        if not nodes or any("nodePosition" not in node for node in nodes):
            return "malformed"
        if any(node["nodePosition"]["mapId"] != self.settings.map for node in nodes):
            return "map"
        if its_own:
            if number <= self.update:
                return None if number == self.update else "outdated"
            if self.cancelled or self.cancelling:
                return "cancelled"
            return None if _name(nodes[0]) == self.end else "unstitched"
        if self.base:
            return "active"
        return "malformed" if number else None if self._near(nodes[0]) else "far"

    def _near(self, node: Json) -> bool:
        """Whether one is at a node as exactly as it wants."""
        position = node["nodePosition"]
        reach = self.settings.dialect.reach(position.get("allowedDeviationXY"))
        askew = math.remainder(position.get("theta", self.heading) - self.heading, math.tau)
        turned = abs(askew) <= position.get("allowedDeviationTheta", 0.0)
        return turned and math.dist(self.place, (position["x"], position["y"])) <= reach


def _released(message: Json) -> list[Json]:
    """The nodes of an order that may be driven to; none where it does not hang together."""
    nodes, edges = message["nodes"], message["edges"]
    parts = sorted([*nodes, *edges], key=lambda part: part["sequenceId"])
    whole = len(nodes) == len(edges) + 1 and parts[::2] == nodes and parts[1::2] == edges
    numbers = [part["sequenceId"] for part in parts]
    if not whole or numbers != [*range(numbers[0], numbers[0] + len(parts))] or numbers[0] % 2:
        return []
    return [node for node in nodes if node["released"]]


def _name(node: Mapping[str, Any]) -> tuple[str, int]:
    return node["nodeId"], node["sequenceId"]


def _part(part: Mapping[str, Any], key: str) -> Json:
    return {key: part[key], "sequenceId": part["sequenceId"], "released": True}
