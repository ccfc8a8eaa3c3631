"""How much of a path an order releases, when it is sent again, and what hinders it."""

from typing import Any

import pytest
from formup.tools.fleet.vda5050.hearing import hindrances
from formup.tools.fleet.vda5050.orders import Order
from formup.tools.fleet.vda5050.settings import Vda5050Settings
from formup.tools.fleet.vda5050.spec import DIALECTS

Json = dict[str, Any]
PREDEFINED = {
    "UNSUPPORTED_PARAMETER": "CRITICAL",
    "VALIDATION_FAILURE": "WARNING",
    "INVALID_ORDER_ACTION": "WARNING",
    "OUTDATED_ORDER_UPDATE": "WARNING",
    "SAME_ORDER_UPDATE_ID": "WARNING",
    "ORDER_UPDATE_FOLLOWING_CANCEL": "WARNING",
    "OUTSIDE_OF_CORRIDOR": "CRITICAL",
    "INSUFFICIENT_MEMORY": "URGENT",
    "BLOCKED_ZONE_VIOLATION": "CRITICAL",
    "RELEASE_LOST": "CRITICAL",
    "ZONE_ACTION_CONFLICT": "CRITICAL",
    "NODE_UNREACHABLE": "CRITICAL",
    "LOCALIZATION_ERROR": "FATAL",
    "NO_ROUTE_TO_TARGET": "WARNING",
    "OTHER_ORDER_ACTIVE": "WARNING",
    "START_NODE_OUT_OF_RANGE": "WARNING",
    "MOBILE_ROBOT_NOT_AVAILABLE": "WARNING",
    "UNKNOWN_MAP_ID": "WARNING",
}
"""Errors of Table 9 of VDA 5050 3.0 that concern an order or the drive, and their levels."""
NO_HARM = {
    "NO_ORDER_TO_CANCEL": "WARNING",
    "INVALID_INSTANT_ACTION": "WARNING",
    "DUPLICATE_MAP": "WARNING",
    "DUPLICATE_ZONE_SET": "WARNING",
}
"""The others of that table."""


def order(version: str = "3.0", errors: tuple[Json, ...] = ()) -> Order:
    settings = {
        "version": version,
        "broker": "mqtt://h",
        "interface": "uagv",
        "manufacturer": "KIT",
        "map": "hall",
        "robots": ["a"],
        "speed": 1,
        "radius": 1,
        "tracking_error": 0.1,
    }
    made = Vda5050Settings.model_validate(settings)
    return Order(made, "o", (0.0, 0.0), {"errors": [*errors]})


def state(number: int, passed: int, *errors: Json, of: str = "o", left: bool = True) -> Json:
    return {
        "orderId": of,
        "orderUpdateId": number,
        "lastNodeSequenceId": passed,
        "nodeStates": [{}] if left else [],
        "errors": [*errors],
    }


def end(message: Json | None) -> float | None:
    return None if message is None else message["nodes"][-1]["nodePosition"]["x"]


def test_a_node_is_released_when_it_is_far_enough_on_or_the_point_ahead_waits() -> None:
    one = order()
    one.go_on((0.0, 0.0), 0.0)
    assert one.message(0.0) is None, "there is nowhere to go"
    one.go_on((0.2, 0.0), 0.0)
    assert one.message(0.0) is None, "it is not far enough"
    one.go_on((0.2, 0.0), 0.1)
    assert one.message(0.1) is None
    one.go_on((0.2, 0.0), 0.25)
    assert end(one.message(0.25)) == 0.2, "the point has waited"
    assert one.hindrance(state(0, 0), 0.3) is None
    one.go_on((0.4, 0.0), 0.3)
    assert one.message(0.3) is None
    one.go_on((0.5, 0.0), 0.35)
    assert end(one.message(0.35)) == 0.5, "it is far enough"


def test_nothing_more_is_released_until_the_vehicle_has_taken_what_was() -> None:
    one = order()
    one.go_on((0.5, 0.0), 0.0)
    first = one.message(0.0)
    one.go_on((1.0, 0.0), 0.1)
    assert one.message(0.1) is None
    assert one.message(0.6) == first, "it is sent again"
    assert one.message(1.0) is None
    assert one.message(1.7) == first
    assert one.hindrance(state(0, 0, of="another"), 3.9) is None
    assert "has not taken order o/0 in 4 s" in (one.hindrance(state(7, 0, of="another"), 4.1) or "")
    assert one.hindrance(state(0, 0), 4.2) is None
    one.go_on((1.0, 0.0), 4.3)
    assert (one.message(4.3) or {})["orderUpdateId"] == 1
    assert not one.done(state(0, 2, left=False))
    assert one.hindrance(state(1, 2), 4.4) is None
    assert one.done(state(1, 4, left=False))


@pytest.mark.parametrize(("kind", "level"), PREDEFINED.items())
def test_every_error_of_the_standard_that_concerns_it_is_named(kind: str, level: str) -> None:
    error = {"errorType": kind, "errorLevel": level}
    one = order()
    one.go_on((0.5, 0.0), 0.0)
    said = state(0, 0, error, of="before")
    words = [*hindrances(DIALECTS["3.0"], said), one.hindrance(said, 0.1) or ""]
    assert f"{kind} ({level})" in " ".join(words)


@pytest.mark.parametrize(("kind", "level"), NO_HARM.items())
def test_other_errors_of_the_standard_hinder_nobody(kind: str, level: str) -> None:
    error = {"errorType": kind, "errorLevel": level}
    one = order()
    one.go_on((0.5, 0.0), 0.0)
    said = state(0, 0, error, of="before")
    assert not hindrances(DIALECTS["3.0"], said)
    assert one.hindrance(said, 0.1) is None


@pytest.mark.parametrize(
    "kind", ["validationError", "orderError", "orderUpdateError", "noRouteError"]
)
def test_what_was_complained_of_before_is_no_refusal_of_this_order(kind: str) -> None:
    old: Json = {"errorType": kind, "errorLevel": "WARNING"}
    one = order("2.1", (old,))
    one.go_on((0.5, 0.0), 0.0)
    assert one.hindrance(state(3, 0, old, of="before"), 0.1) is None
    new = old | {"errorDescription": "too far"}
    assert f"{kind} (WARNING): too far" in (
        one.hindrance(state(3, 0, old, new, of="before"), 0.2) or ""
    )


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (state(0, 0, left=False), "was cancelled there"),
        (state(0, 2, left=False), None),
        (state(0, 0, of=""), "it has ''"),
        (state(4, 0, of="another"), "it has 'another'"),
    ],
)
def test_an_order_that_is_gone_is_missed(said: Json, words: str | None) -> None:
    one = order()
    one.go_on((0.5, 0.0), 0.0)
    assert one.hindrance(state(0, 0), 0.1) is None
    found = one.hindrance(said, 0.2)
    assert (found is None) if words is None else (words in (found or ""))
