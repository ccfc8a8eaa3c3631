"""A drawn room, as a camera sees it, with robots where the stand-ins truly are."""

import asyncio
import math
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from formup.tools.draw.room import Room
from formup.tools.fleet.arrival import Arrival
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import deploy
from formup.tools.fleet.protocol import Pose, points_of
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.formation.site import Site
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.cameras.calibration import Calibration, Residuals, through

ROOM = Room(picture=(960, 540), tag_size=0.12, tag_height=0.1, eye=(2.0, -0.4, 2.9), aim=(2, 1.4))
TAGS = {"a": 4, "b": 7, "c": 11}
LOOK = 0.3
"""Of a tag on a robot that has no heading, radians."""
EXACT = Residuals(mean_px=0, worst_px=0, mean_mm=0, worst_mm=0, corners_mm=0)
rows: Any = ROOM.homography.tolist()
SEEN = Calibration(
    picture=ROOM.picture,
    homography=rows,
    camera=ROOM.eye,
    floor=(0.2, 0.2, 3.8, 2.8),
    metres_per_pixel=0.005,
    residuals=EXACT,
)
MORE: dict[str, Any] = {
    "speed": 0.5,
    "radius": 0.06,
    "tracking_error": 0.02,
    "pose_timeout": 1.0,
    "watchdog": 1.0,
    "simulated": {"starts": [[0.6, 0.6], [0.6, 1.1], [0.6, 1.6]]},
    "camera": {
        "source": 0,
        "calibration": "camera.yaml",
        "tags": TAGS,
        "tag_size": 0.12,
        "tag_height": 0.1,
    },
}


class Drawn:
    """In `cv2.VideoCapture`'s place: what a camera above the stand-ins sees, as it is now."""

    def __init__(self) -> None:
        self.lab: Any = None
        self.covered = set[str]()
        self.hangs, self.old, self.over = False, False, threading.Event()
        self._n, self._last = 0, ROOM.frame({})

    def __call__(self, source: int) -> "Drawn":
        assert source == 0
        return self

    def isOpened(self) -> bool:  # noqa: N802
        return True

    def set(self, name: int, value: float) -> bool:
        return True

    def read(self) -> tuple[bool, np.ndarray]:
        if self.hangs:
            self.over.wait()
        self.over.wait(0.03)
        if self.lab is not None and not self.old:
            floor = through(np.linalg.inv(SEEN.to_top), self.lab.robots.points)
            poses = zip(TAGS, floor.tolist(), self.looks(), strict=True)
            seen = {TAGS[r]: (x, y, a) for r, (x, y), a in poses if r not in self.covered}
            self._n += 1
            self._last = ROOM.frame(seen, thing=(2.4, 1.5, 0.2), seed=self._n)
        return True, self._last

    def looks(self) -> list[float]:
        """How robots look on the floor; those without a heading have tags that are turned."""
        looks, frame = self.lab.robots._sim.headings.tolist(), self.lab.settings.frame
        return [LOOK if math.isnan(look) else frame.turned_back(look) for look in looks]

    def release(self) -> None:
        """Nothing is held."""


def plan() -> tuple[Plan, Site]:
    around = [(2.1, 1.3), (2.7, 1.3), (2.7, 1.7), (2.1, 1.7)]
    outline = make_outline(through(SEEN.to_top, np.array(around)).tolist())
    site = Site({"t1": outline}, *SEEN.size)
    groups = (Group(relation="around", targets=("t1",), robots=3),)
    return make_plan(Contract(groups=groups, robot_radius=12), site, "s"), site


def deployed(lab: Any, act: Callable[[], object] = lambda: None) -> tuple[Arrival, Plan]:
    """What comes of a deployment when something happens once robots are on their way."""
    planned, site = plan()
    begun: list[Pose] = []
    done = False

    def watch(poses: tuple[Pose, ...]) -> None:
        nonlocal done
        begun[:] = begun or poses
        if not done and np.abs(points_of(poses) - points_of(begun)).max() > 20:
            done = True
            act()

    async def go() -> Arrival:
        fleet = lab.fleet()
        try:
            robots = assign_robots(await fleet.observe(), planned.formation.points).robots
            return (await deploy(planned, site, fleet, robots, watch=watch)).arrival
        finally:
            await fleet.close()

    return asyncio.run(go()), planned
