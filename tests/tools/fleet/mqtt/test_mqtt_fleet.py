"""Robots on a real broker are a fleet like any other."""

import asyncio
from collections.abc import Callable
from typing import Any

from formup.tools.fleet.conformance import check_fleet

Labs = Callable[..., Any]


def test_it_passes_what_every_fleet_has_to(lab: Labs) -> None:
    there = lab().simulate()
    asyncio.run(check_fleet(there.fleet))
