"""What differs between the versions of VDA 5050 that are spoken: names of fields and of errors."""

from collections.abc import Mapping
from typing import Any, Literal

Version = Literal["2.1", "3.0"]
Refusal = Literal[
    "malformed", "outdated", "cancelled", "unstitched", "active", "far", "map", "unavailable"
]
"""Why a vehicle does not take an order."""
_REFUSALS: Mapping[Refusal, tuple[str, str]] = {
    "malformed": ("validationError", "VALIDATION_FAILURE"),
    "outdated": ("orderUpdateError", "OUTDATED_ORDER_UPDATE"),
    "cancelled": ("orderUpdateError", "ORDER_UPDATE_FOLLOWING_CANCEL"),
    "unstitched": ("orderUpdateError", "INVALID_ORDER"),
    "active": ("orderUpdateError", "OTHER_ORDER_ACTIVE"),
    "far": ("noRouteError", "START_NODE_OUT_OF_RANGE"),
    "map": ("orderError", "UNKNOWN_MAP_ID"),
    "unavailable": ("orderError", "MOBILE_ROBOT_NOT_AVAILABLE"),
}
_MORE = {
    "UNSUPPORTED_PARAMETER",
    "INVALID_ORDER_ACTION",
    "SAME_ORDER_UPDATE_ID",
    "INSUFFICIENT_MEMORY",
    "NODE_UNREACHABLE",
    "NO_ROUTE_TO_TARGET",
}


class Dialect:
    """One version.

    Attributes:
        number, level: the version in the header of messages, and in topics.
        position, located: the field of where a vehicle is, and the one within that says whether it
            knows.
        emergency: the field of the emergency stop, within `safetyState`.
        instant: the field with the states of instant actions.
        speed: the field of an edge for the greatest speed.
        power, charge: the field of the battery, and the one within of how full it is.
        broken: the last will of a vehicle.
        grave: levels of errors at which a vehicle cannot go on with its order.
        refusals: the error that a vehicle has for each reason; `refused`: all about orders.
        idle: the error of a vehicle that was told to cancel an order and has none.
    """

    def __init__(self, version: Version) -> None:
        self._newer = newer = version == "3.0"
        self.number, self.level = f"{version}.0", f"v{version[0]}"
        self.position = "mobileRobotPosition" if newer else "agvPosition"
        self.located = "localized" if newer else "positionInitialized"
        self.emergency = "activeEmergencyStop" if newer else "eStop"
        self.instant = "instantActionStates" if newer else "actionStates"
        self.speed = "maximumSpeed" if newer else "maxSpeed"
        self.power = "powerSupply" if newer else "batteryState"
        self.charge = "stateOfCharge" if newer else "batteryCharge"
        self.broken = "CONNECTION_BROKEN" if newer else "CONNECTIONBROKEN"
        self.grave = frozenset({"FATAL", *(("CRITICAL",) if newer else ())})
        self.refusals = {reason: names[newer] for reason, names in _REFUSALS.items()}
        self.refused = frozenset(self.refusals.values()) | _MORE
        self.idle = "NO_ORDER_TO_CANCEL" if newer else "noOrderToCancel"

    def deviation(self, length: float) -> float | dict[str, float]:
        """How a node says how far from it a vehicle may be, in the robots' frame."""
        return {"a": length, "b": length, "theta": 0.0} if self._newer else length

    def reach(self, deviation: Any) -> float:
        """How far from a node a vehicle may be in any direction, by what the node says."""
        if deviation is None or not self._newer:
            return deviation or 0.0
        return min(deviation["a"], deviation["b"])

    def ends(self, begin: str, end: str) -> dict[str, str]:
        """What an edge says of the nodes that it joins."""
        return {} if self._newer else {"startNodeId": begin, "endNodeId": end}

    def reference(self, state: int) -> dict[str, int]:
        """What a visualization says of the last state before it, by its number."""
        return {"referenceStateHeaderId": state} if self._newer else {}


DIALECTS: Mapping[Version, Dialect] = {"2.1": Dialect("2.1"), "3.0": Dialect("3.0")}
