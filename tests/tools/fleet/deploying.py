"""Deployments of robots elsewhere during which something happens, whatever the wire is."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from formup.tools.fleet.arrival import Arrival
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import deploy
from formup.tools.fleet.protocol import Fleet, Pose
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import make_plan
from formup.tools.formation.site import Site
from formup.tools.geometry.outline import make_outline

SITE = Site({"t1": make_outline([(200, 200), (300, 200), (300, 300), (200, 300)])}, 640, 480)
PLAN = make_plan(
    Contract(groups=(Group(relation="around", targets=("t1",), robots=3),), robot_radius=5),
    SITE,
    "s",
)
SURE = {"speed": 200, "pose_timeout": 1.0, "watchdog": 1.0}
"""Fast, and with time enough for a machine that does other things too."""
PATIENCE = 10.0
Act = Callable[[Any, Fleet], object]


@dataclass(frozen=True)
class Case:
    """What happens on the way, how it ends, and what is told of it."""

    act: Act
    ended: str
    words: str = ""
    failed: tuple[str, ...] = ()


def wait_for(what: Callable[[], object]) -> None:
    ends = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < ends, "it has not come about"
        time.sleep(0.01)


def deployed(lab: Any, fleet: Fleet, act: Act = lambda lab, fleet: None) -> Arrival:
    """What comes of a deployment when something happens once robots are on their way."""
    begun: list[Pose] = []
    done = False

    def watch(poses: tuple[Pose, ...]) -> None:
        nonlocal done
        begun[:] = begun or poses
        pairs = zip(begun, poses, strict=True)
        if not done and any(abs(a.x - b.x) + abs(a.y - b.y) > 20 for a, b in pairs):
            done = True
            act(lab, fleet)

    async def go() -> Arrival:
        robots = assign_robots(await fleet.observe(), PLAN.formation.points).robots
        return (await deploy(PLAN, SITE, fleet, robots, watch=watch)).arrival

    return asyncio.run(go())


def stand(lab: Any) -> bool:
    before = lab.robots.points.copy()
    time.sleep(0.2)
    return bool(abs(lab.robots.points - before).max() < 0.5)


def stops(lab: Any, fleet: Fleet) -> None:
    asyncio.get_running_loop().create_task(fleet.stop())
