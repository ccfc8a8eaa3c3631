"""What differs between the versions of VDA 5050 that are spoken: names of fields and of errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Version = Literal["2.1", "3.0"]
Refusal = Literal[
    "malformed", "outdated", "cancelled", "unstitched", "active", "far", "map", "unavailable"
]
"""Why a vehicle does not take an order."""


@dataclass(frozen=True)
class Dialect:
    """One version.

    Attributes:
        number: in the header of messages.
        level: in topics.
        position, located: the field of where a vehicle is, and the one within that says whether it
            knows.
        emergency: the field of the emergency stop, within `safetyState`.
        instant: the field with the states of instant actions.
        speed: the field of an edge for the greatest speed.
        power, charge: the field of the battery, and the one within of how full it is.
        broken: the last will of a vehicle.
        grave: levels of errors at which a vehicle cannot go on with its order.
        refusals: the errors of orders that are not taken.
        refused: all that may be said of such.
        idle: the error of a vehicle that was told to cancel an order and has none.
    """

    number: str
    level: str
    position: str
    located: str
    emergency: str
    instant: str
    speed: str
    power: str
    charge: str
    broken: str
    grave: frozenset[str]
    refusals: Mapping[Refusal, str]
    refused: frozenset[str]
    idle: str

    def deviation(self, length: float) -> float | dict[str, float]:
        """How a node says how far from it a vehicle may be, in the robots' frame."""
        return length if self.level == "v2" else {"a": length, "b": length, "theta": 0.0}

    def reach(self, deviation: Any) -> float:
        """How far from a node a vehicle may be in any direction, by what the node says."""
        if deviation is None or self.level == "v2":
            return deviation or 0.0
        return min(deviation["a"], deviation["b"])

    def ends(self, begin: str, end: str) -> dict[str, str]:
        """What an edge says of the nodes that it joins."""
        return {"startNodeId": begin, "endNodeId": end} if self.level == "v2" else {}

    def reference(self, state: int) -> dict[str, int]:
        """What a visualization says of the last state before it, by its number."""
        return {} if self.level == "v2" else {"referenceStateHeaderId": state}

    def power_state(self, percent: float) -> dict[str, Any]:
        """What a vehicle says of its battery."""
        return {self.charge: percent, "charging": False}


_REFUSALS_2: Mapping[Refusal, str] = {
    "malformed": "validationError",
    "outdated": "orderUpdateError",
    "cancelled": "orderUpdateError",
    "unstitched": "orderUpdateError",
    "active": "orderUpdateError",
    "far": "noRouteError",
    "map": "orderError",
    "unavailable": "orderError",
}
_REFUSALS_3: Mapping[Refusal, str] = {
    "malformed": "VALIDATION_FAILURE",
    "outdated": "OUTDATED_ORDER_UPDATE",
    "cancelled": "ORDER_UPDATE_FOLLOWING_CANCEL",
    "unstitched": "INVALID_ORDER",
    "active": "OTHER_ORDER_ACTIVE",
    "far": "START_NODE_OUT_OF_RANGE",
    "map": "UNKNOWN_MAP_ID",
    "unavailable": "MOBILE_ROBOT_NOT_AVAILABLE",
}
_MORE_3 = {
    "UNSUPPORTED_PARAMETER",
    "INVALID_ORDER_ACTION",
    "SAME_ORDER_UPDATE_ID",
    "INSUFFICIENT_MEMORY",
    "NODE_UNREACHABLE",
    "NO_ROUTE_TO_TARGET",
}
DIALECTS: Mapping[Version, Dialect] = {
    "2.1": Dialect(
        number="2.1.0",
        level="v2",
        position="agvPosition",
        located="positionInitialized",
        emergency="eStop",
        instant="actionStates",
        speed="maxSpeed",
        power="batteryState",
        charge="batteryCharge",
        broken="CONNECTIONBROKEN",
        grave=frozenset({"FATAL"}),
        refusals=_REFUSALS_2,
        refused=frozenset(_REFUSALS_2.values()),
        idle="noOrderToCancel",
    ),
    "3.0": Dialect(
        number="3.0.0",
        level="v3",
        position="mobileRobotPosition",
        located="localized",
        emergency="activeEmergencyStop",
        instant="instantActionStates",
        speed="maximumSpeed",
        power="powerSupply",
        charge="stateOfCharge",
        broken="CONNECTION_BROKEN",
        grave=frozenset({"CRITICAL", "FATAL"}),
        refusals=_REFUSALS_3,
        refused=frozenset(_REFUSALS_3.values()) | _MORE_3,
        idle="NO_ORDER_TO_CANCEL",
    ),
}
