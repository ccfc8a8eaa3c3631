"""Vehicles that a camera sees: it says where they are, and they say whether they can drive."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from drawn import MORE, SEEN, Drawn, deployed
from formup.tools.errors import InputError
from formup.tools.fleet.protocol import FleetRequest
from formup.tools.fleet.vda5050.checkup import checked
from formup.tools.fleet.vda5050.fleet import open_fleet

Halls = Callable[..., Any]
Json = dict[str, Any]
SEEN_FROM_ABOVE = {key: what for key, what in MORE.items() if key != "watchdog"}


def elsewhere(kind: str, message: Json) -> Json | None:
    """A vehicle that says where it is, wrongly, with each state alone."""
    if kind == "visualization":
        return None
    wrong = {"x": 3.0, "y": 2.5}
    return message | {k: message[k] | wrong for k in message if k == "agvPosition"}


def without_state(kind: str, message: Json) -> Json | None:
    return None if kind == "state" else message


@pytest.fixture
def there(hall: Halls, drawn: Drawn) -> Any:
    made = hall(**SEEN_FROM_ABOVE).simulate()
    drawn.lab = made
    return made


def test_vehicles_arrive_by_what_the_camera_sees(there: Any) -> None:
    there.robots.faults.update(dict.fromkeys("abc", elsewhere))
    arrival, planned = deployed(there)
    assert arrival.arrived, arrival
    off = there.robots.points[:, None] - planned.formation.points[None]
    assert np.linalg.norm(off, axis=2).min(axis=1).max() * SEEN.metres_per_pixel < 0.01


def test_a_vehicle_that_is_seen_and_cannot_drive_is_named(there: Any) -> None:
    def act() -> None:
        there.robots.vehicles["b"].emergency = "MANUAL"

    arrival, _ = deployed(there, act)
    assert (arrival.ended, arrival.failed) == ("failed", ("b",)), arrival
    assert "emergency stop" in (arrival.reason or "")


def test_the_check_sees_vehicles_by_their_tags_and_believes_none_without_its_state(
    there: Any, drawn: Drawn
) -> None:
    there.robots.faults.update(a=elsewhere, c=without_state)
    drawn.covered.add("b")
    told, fit = checked(there.settings, 2.5)
    said = "\n".join(told)
    assert (fit, told[-1]) == (False, "1 of 3 robots can be driven."), said
    assert "Robot b not seen yet." in said
    assert "Robot c not seen yet; its last message was without a state." in said


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"camera": MORE["camera"] | {"tags": {"a": 4, "b": 7}}}, "camera.tags takes every robot"),
        ({"frame": {"y": "down"}}, "frame is that of the camera's calibration"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    hall: Halls, drawn: Drawn, more: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        hall(**{**SEEN_FROM_ABOVE, **more})


def test_a_picture_that_the_camera_has_not_seen_from_above_is_refused(
    hall: Halls, drawn: Drawn
) -> None:
    made = hall(**SEEN_FROM_ABOVE)
    with pytest.raises(InputError, match="720 x 520"):
        open_fleet(FleetRequest((640, 480), 3, config=made.path))
