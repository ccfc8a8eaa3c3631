"""Vehicles of VDA 5050 at a real broker are a fleet like any other, and say only what is valid."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from deploying import check_headings
from formup.tools.fleet.conformance import check_fleet

Halls = Callable[..., Any]


@pytest.mark.parametrize("turns", [False, True])
@pytest.mark.parametrize("version", ["2.1", "3.0"])
def test_they_pass_what_every_fleet_has_to(hall: Halls, version: str, turns: bool) -> None:
    there = hall(version=version, speed=100, turns=turns).simulate()
    asyncio.run(check_fleet(there.fleet))


@pytest.mark.parametrize("drive", ["point", "differential"])
def test_vehicles_look_where_a_plan_says_and_the_last_node_alone_says_so(
    hall: Halls, drive: str
) -> None:
    simulated = {"starts": [[50, 50], [50, 100], [50, 150]], "drive": drive}
    there = hall(turns=True, simulated=simulated)
    said = there.overhear()
    there.simulate()
    check_headings(there)
    orders = [message for topic, message in there.all_of(said) if topic.endswith("a/order")]
    first = [order for order in orders if order["orderId"] == orders[0]["orderId"]]
    nodes = [order["nodes"][-1]["nodePosition"] for order in first]
    with_theta = [i for i, node in enumerate(nodes) if "theta" in node]
    assert with_theta == [*range(with_theta[0], len(nodes))]
    ends = {(nodes[i]["x"], nodes[i]["y"]) for i in with_theta}
    assert len(ends) == 1, "of the way there, only the end"
