"""Robots elsewhere that are simulated, and deployments of them in which something happens."""

import asyncio
import math
import os
import re
import shlex
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import yaml
from formup.tools.fleet.arrival import Arrival
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import ARRIVED_DEG, deploy
from formup.tools.fleet.protocol import Fleet, Pose
from formup.tools.fleet.wire.stand_in import StandIns
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.headings import off_heading
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.formation.site import Site
from formup.tools.geometry.outline import make_outline

SITE = Site({"t1": make_outline([(200, 200), (300, 200), (300, 300), (200, 300)])}, 640, 480)
GROUP = Group(relation="around", targets=("t1",), robots=3)
PLAN = make_plan(Contract(groups=(GROUP,), robot_radius=5), SITE, "s")
AWAY = make_plan(
    Contract(groups=(GROUP.model_copy(update={"heading": "away"}),), robot_radius=5), SITE, "s"
)
"""The same, but robots look away from the thing."""
SURE = {"speed": 200, "pose_timeout": 1.0, "watchdog": 1.0}
"""Fast, and with time enough for a machine that does other things too."""
PATIENCE = 10.0
Act = Callable[[Any, Fleet], object]
Robots = TypeVar("Robots", bound=StandIns)
ROOT = Path(__file__).parents[3]
STAYING = ("mosquitto", "formup fleet simulate")
"""Commands of pages that go on beside the others."""


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


class Simulated(Generic[Robots]):
    """A fleet's file, its stand-ins in a thread, and what they told."""

    def __init__(self, path: Path, given: dict[str, Any]) -> None:
        path.write_text(yaml.safe_dump(given))
        self.path, self.told = path, list[str]()
        self.done = threading.Event()
        self._robots: Robots | None = None
        self._thread: threading.Thread | None = None

    @property
    def robots(self) -> Robots:
        assert self._robots is not None
        return self._robots

    def run(self, robots: Robots, joined: Callable[[], bool]) -> None:
        """Let stand-ins go on once they are connected."""
        self._robots = robots
        wait_for(joined)
        self._thread = threading.Thread(target=robots.run, args=(self.done.is_set,))
        self._thread.start()

    def was_told(self, what: str) -> bool:
        return any(what in text for text in self.told)

    def named(self, what: str) -> set[str]:
        """Robots of whom something was told, in one sentence or several."""
        told = [text.rpartition(": ")[2].split(", ") for text in [*self.told] if what in text]
        return {robot for robots in told for robot in robots}

    def end(self) -> None:
        self.done.set()
        if self._thread is not None:
            self._thread.join()
        if self._robots is not None:
            self._robots.close()


Made = TypeVar("Made", bound=Simulated[Any])


@contextmanager
def ended(make: Callable[..., Made]) -> Generator[Callable[..., Made]]:
    """What makes simulated fleets, which are ended after."""
    made: list[Made] = []

    def kept(*args: Any, **more: Any) -> Made:
        made.append(make(*args, **more))
        return made[-1]

    yield kept
    for one in made:
        one.end()


def deployed(
    lab: Any, fleet: Fleet, act: Act = lambda lab, fleet: None, plan: Plan = PLAN
) -> Arrival:
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
        robots = assign_robots(await fleet.observe(), plan.formation.points).robots
        return (await deploy(plan, SITE, fleet, robots, watch=watch)).arrival

    return asyncio.run(go())


def check_headings(lab: Any) -> None:
    """Robots are sent to headings, seen to look there, and truly do."""
    fleet = lab.fleet()
    arrival = deployed(lab, fleet, plan=AWAY)
    assert arrival.arrived, arrival
    asyncio.run(fleet.close())
    frame = lab.settings.frame
    for robot, wanted in zip(arrival.robots, AWAY.formation.headings_deg, strict=True):
        look = math.degrees(frame.turned(lab.robots.heading(robot)))
        assert off_heading(look, wanted or 0.0) <= ARRIVED_DEG, robot


def stand(lab: Any) -> bool:
    before = lab.robots.points.copy()
    time.sleep(0.3)
    return bool(abs(lab.robots.points - before).max() < 0.5)


def stops(lab: Any, fleet: Fleet) -> None:
    asyncio.get_running_loop().create_task(fleet.stop())


def commands_of(page: str) -> list[str]:
    """What the blocks of a page of docs have one type."""
    blocks = re.findall(r"```console\n(.*?)```", page, re.DOTALL)
    return [line.removeprefix("$ ") for block in blocks for line in block.splitlines()]


def keys_of(page: str) -> set[str]:
    """The keys of a fleet's file that the table of a page of docs names."""
    rows = page.partition("| key | |")[2].partition("\n\n")[0].splitlines()[2:]
    return {key for row in rows for key in re.findall(r"`(\w+)`", row.split("|")[1])}


def checkout(folder: Path, was: str, now: str, *examples: str) -> Path:
    """A folder with the docs, and with examples that are at another port."""
    (folder / "docs").symlink_to(ROOT / "docs")
    (folder / "examples").mkdir()
    for name in examples:
        text = (ROOT / "examples" / name).read_text("utf-8")
        assert was in text
        (folder / "examples" / name).write_text(text.replace(was, now))
    return folder


def followed(commands: Sequence[str], folder: Path) -> dict[str, str]:
    """What commands print that are run one after the other, by their first three words."""
    path = f"{os.environ['PATH']}:/usr/sbin"
    home = os.environ | {"XDG_DATA_HOME": str(folder), "PATH": path, "PYTHONUNBUFFERED": "1"}
    said: dict[str, str] = {}
    with ExitStack() as staying:
        for command in commands:
            parts = shlex.split(command)
            parts = [sys.executable, "-m", *parts] if parts[0] == "formup" else parts
            begun = subprocess.Popen(
                parts, cwd=folder, env=home, stdout=subprocess.PIPE, stderr=subprocess.PIPE
            )
            if command.startswith(STAYING):
                staying.callback(begun.communicate)
                staying.callback(begun.kill)
                if command.startswith("formup"):
                    assert begun.stdout is not None
                    assert b"standing in for 6 robots" in begun.stdout.readline()
                continue
            out, problems = begun.communicate()
            assert begun.returncode == 0, out + problems
            said[" ".join(command.split()[:3])] = out.decode()
    return said
