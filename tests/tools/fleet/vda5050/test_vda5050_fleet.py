"""Vehicles of VDA 5050 at a real broker are a fleet like any other, and say only what is valid."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from formup.tools.fleet.conformance import check_fleet

Halls = Callable[..., Any]


@pytest.mark.parametrize("version", ["2.1", "3.0"])
def test_they_pass_what_every_fleet_has_to(hall: Halls, version: str) -> None:
    there = hall(version=version, speed=100).simulate()
    asyncio.run(check_fleet(there.fleet))
