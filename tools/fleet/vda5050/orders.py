"""The order that takes one vehicle along its path, of which a little is released at a time.

Every update takes it on by one edge, from the last node released. None is sent before the vehicle
is seen to have taken the one before, and that one is sent again until then: orders may be lost.
"""

import math
from collections.abc import Mapping
from typing import Any

from ..wire.fleet import AHEAD, Point
from .hearing import error_told
from .settings import Vda5050Settings

STEP = AHEAD / 2
"""A node is released when it is as far on as a vehicle drives in so many seconds,"""
WAITS = 0.2
"""or when the point ahead of it has not moved for so many: it is a bend, a halt or the end."""
EXACT = 1e-6
LOOKING = 0.01
"""A vehicle that is to look somewhere does within so many radians."""
MOST_THETA = 3.141592
AGAIN = 0.5
"""Seconds after which an order that is not seen to be taken is sent again; then twice as many."""
TAKEN = 4.0
"""Seconds in which it has to be taken."""


class Order:
    """One vehicle's, in one drive; points are in the robots' frame.

    Args:
        name: of the order.
        start: where the vehicle stands.
        state: the last it said: what it complains of there has nothing to do with this order.
    """

    def __init__(
        self, settings: Vda5050Settings, name: str, start: Point, state: Mapping[str, Any]
    ) -> None:
        self._settings, self.name = settings, name
        self._points, self._goal, self._since = [start], start, math.inf
        self._looks: list[float | None] = [None]
        self._before: list[Any] = state.get("errors", [])
        self._taken, self._begun, self._known = True, 0.0, False
        self._due, self._pause = math.inf, AGAIN

    def go_on(self, goal: Point, now: float, look: float | None = None) -> None:
        """Take in a point further along the path, and release it where that is due.

        Args:
            look: which way the vehicle is to look there; None for any.
        """
        if math.dist(goal, self._goal) > EXACT:
            self._goal, self._since = goal, now
        way = math.dist(goal, self._points[-1])
        further = way > EXACT or look != self._looks[-1]
        waits = now - self._since >= WAITS and further
        if self._taken and (waits or way >= STEP * self._settings.speed):
            self._points.append(goal)
            self._looks.append(look)
            self._taken, self._begun = False, now
            self._due, self._pause = now, AGAIN

    def message(self, now: float) -> dict[str, Any] | None:
        """What is to be sent now; None for nothing."""
        if self._taken or now < self._due:
            return None
        self._due, self._pause = now + self._pause, 2 * self._pause
        number = self._number
        nodes = [self._node(number), self._node(number + 1)]
        dialect = self._settings.dialect
        edge: dict[str, Any] = {
            "edgeId": f"{self.name}-{2 * number + 1}",
            "sequenceId": 2 * number + 1,
            "released": True,
            **dialect.ends(nodes[0]["nodeId"], nodes[1]["nodeId"]),
            dialect.speed: self._settings.speed,
            "actions": [],
        }
        return {"orderId": self.name, "orderUpdateId": number, "nodes": nodes, "edges": [edge]}

    def hindrance(self, state: Mapping[str, Any], now: float) -> str | None:
        """Take in a state, and say why the order cannot be gone on with; None if it can."""
        number, its_own = state["orderUpdateId"], state["orderId"] == self.name
        dialect, errors = self._settings.dialect, state["errors"]
        grave = [error for error in errors if error["errorLevel"] in dialect.grave]
        if its_own and number == self._number:
            self._taken = self._known = True
            self._before = [
                error for error in errors if error not in grave or error in self._before
            ]
        new = [e for e in (grave if self._taken else errors) if e not in self._before]
        refused = [error_told(error) for error in new if error["errorType"] in dialect.refused]
        if refused:
            return f"refused order {self.name}/{self._number}: {refused[0]}"
        if self._known and not its_own:
            return f"its order {self.name} is gone: it has {state['orderId']!r}"
        cut = state["lastNodeSequenceId"] < 2 * number + 2
        if its_own and cut and not state["nodeStates"]:
            return f"its order {self.name} is gone: it was cancelled there"
        if not self._taken and now - self._begun > TAKEN:
            return f"has not taken order {self.name}/{self._number} in {TAKEN:g} s"
        return None

    def done(self, state: Mapping[str, Any]) -> bool:
        """Whether the vehicle has nothing left to do of what was sent, by its state."""
        return self._taken and not state["nodeStates"]

    @property
    def _number(self) -> int:
        return len(self._points) - 2

    def _node(self, count: int) -> dict[str, Any]:
        settings, number = self._settings, 2 * count
        place, look = self._points[count], self._looks[count]
        position: dict[str, Any] = {
            "x": round(place[0], 6),
            "y": round(place[1], 6),
            "mapId": settings.map,
            "allowedDeviationXY": settings.dialect.deviation(settings.tracking_error),
        }
        if look is not None:
            position["theta"] = max(-MOST_THETA, min(round(look, 6), MOST_THETA))
            position["allowedDeviationTheta"] = LOOKING
        return {
            "nodeId": f"{self.name}-{number}",
            "sequenceId": number,
            "released": True,
            "nodePosition": position,
            "actions": [],
        }
