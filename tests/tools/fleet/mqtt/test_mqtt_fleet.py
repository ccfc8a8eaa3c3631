"""Robots on a real broker are a fleet like any other."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from deploying import AWAY, SURE, check_headings, deployed
from formup.tools.errors import ToolError
from formup.tools.fleet.conformance import check_fleet
from formup.tools.fleet.protocol import StalePosesError
from formup.tools.fleet.wire import fleet as fleet_module

Labs = Callable[..., Any]
STARTS = [[50, 50], [50, 100], [50, 150]]
WHEELS = {"turns": True, "simulated": {"starts": STARTS, "drive": "differential"}}


def without_heading(message: dict[str, Any], n: int) -> dict[str, Any]:
    return {key: said for key, said in message.items() if key != "heading"}


@pytest.mark.parametrize("more", [{}, {"turns": True}, WHEELS])
def test_it_passes_what_every_fleet_has_to(lab: Labs, more: dict[str, Any]) -> None:
    there = lab(**more).simulate()
    asyncio.run(check_fleet(there.fleet))


def test_robots_look_where_a_plan_says(lab: Labs) -> None:
    check_headings(lab(**SURE, **WHEELS).simulate())


def test_robots_that_turn_and_do_not_say_how_they_look_are_not_driven(
    lab: Labs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fleet_module, "WAIT", 0.5)
    there = lab(turns=True).simulate()
    there.robots.faults.update(b=without_heading)
    fleet = there.fleet()
    with pytest.raises(StalePosesError, match=r"b not seen yet; .* without a heading"):
        asyncio.run(fleet.observe())
    asyncio.run(fleet.close())


def test_robots_that_do_not_turn_are_not_sent_where_a_plan_has_them_look(lab: Labs) -> None:
    there = lab().simulate()
    fleet = there.fleet()
    with pytest.raises(ToolError, match="cannot be turned to a heading"):
        deployed(there, fleet, plan=AWAY)
    asyncio.run(fleet.close())
