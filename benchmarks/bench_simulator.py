"""`python -m formup.benchmarks.bench_simulator`: speed and residuals of the stepping simulator.

It prints steps per second of CPU time beside pyrvo's, if installed, which steps discs that avoid
each other; its positions are read and velocities set at each step, as ours are, and the two take
turns. Then it drives teams on two wheels with 5 % noise, over seeds.
"""

import asyncio
import math
import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from statistics import median
from typing import Any

import numpy as np

from ..tools.fleet.assigning import assign_robots
from ..tools.fleet.deploy import deploy
from ..tools.fleet.physics import Physics
from ..tools.fleet.protocol import FleetRequest, Pose, points_of
from ..tools.fleet.simulated import SimulatedFleet
from ..tools.fleet.simulator import PERIOD, Simulator, tracking_error
from ..tools.fleet.starts import set_down
from ..tools.formation.contract import Contract, Group
from ..tools.formation.plan import make_plan
from ..tools.formation.site import Site
from ..tools.geometry.outline import FloatArray, make_outline
from ..tools.geometry.sampling import min_spacing
from ..tools.motion.motion import Motion

SIZES = (10, 100, 1_000, 10_000)
ROUNDS, ROBOT_STEPS, MOST_STEPS = 3, 100_000, 300
SPEED, RADIUS = 100.0, 3.0
TEAMS, SEEDS, NOISE = (8, 30), 20, 0.05
SITE = Site({"t1": make_outline([(400, 300), (800, 300), (800, 600), (400, 600)])}, 1200, 900)


def _ways(n: int) -> tuple[FloatArray, FloatArray]:
    """Return starts 20 px apart, (n, 2) px, and paths of six legs, (n, 7, 2) px."""
    random, side = np.random.default_rng(n), math.ceil(math.sqrt(n))
    starts = 20.0 * np.stack(np.divmod(np.arange(n), side), axis=1)
    legs = random.uniform(-300, 300, (n, 6, 2))
    return starts, starts[:, None] + np.cumsum(np.pad(legs, ((0, 0), (1, 0), (0, 0))), axis=1)


def _ours(n: int, drive: str) -> Callable[[], object]:
    starts, ways = _ways(n)
    physics = Physics.model_validate(
        {"drive": drive, "speed": SPEED, "acceleration": 4 * SPEED, "slip": 0.02}
    )
    ids = [str(i) for i in range(n)]
    simulator = Simulator(ids, starts, np.full(n, math.nan), physics)
    simulator.begin(Motion(dict(zip(ids, ways, strict=True))))
    return simulator.step


def _fleet(n: int) -> Callable[[], object]:
    """Return a step of `SimulatedFleet.drive`, which makes poses each time."""
    starts, ways = _ways(n)
    poses = [Pose(str(i), float(x), float(y)) for i, (x, y) in enumerate(starts)]
    motion = Motion(dict(zip((pose.id for pose in poses), ways, strict=True)))
    moving, loop = SimulatedFleet(poses, speed=SPEED).drive(motion), asyncio.new_event_loop()
    return lambda: loop.run_until_complete(anext(moving))


def _pyrvo(n: int) -> Callable[[], object]:
    rvo: Any = import_module("pyrvo")
    starts, ways = _ways(n)
    there = rvo.RVOSimulator(PERIOD, 15.0, 10, 5.0, 5.0, RADIUS, SPEED)
    for x, y in starts.tolist():
        there.add_agent((x, y))
    towards = ways[:, 1] - starts
    towards *= SPEED / np.linalg.norm(towards, axis=1, keepdims=True)
    wanted = [(x, y) for x, y in towards.tolist()]

    def step() -> list[Any]:
        for i, velocity in enumerate(wanted):
            there.set_agent_pref_velocity(i, velocity)
        there.do_step()
        return [there.get_agent_position(i) for i in range(n)]

    return step


def _show_steps() -> None:
    makers: dict[str, Callable[[int], Callable[[], object]]] = {
        "point": lambda n: _ours(n, "point"),
        "differential": lambda n: _ours(n, "differential"),
        "fleet, poses": _fleet,
    }
    if find_spec("pyrvo"):
        makers["pyrvo"] = _pyrvo
    print(f"steps a second of CPU time (real time: {1 / PERIOD:.0f})")  # noqa: T201
    print(f"{'robots':>8}" + "".join(f"{name:>15}" for name in makers))  # noqa: T201
    for n in SIZES:
        steps = max(10, min(MOST_STEPS, ROBOT_STEPS // n))
        taken: dict[str, list[float]] = {name: [] for name in makers}
        for _ in range(ROUNDS):
            for name, make in makers.items():
                step = make(n)
                began = time.process_time()
                for _ in range(steps):
                    step()
                taken[name].append(steps / (time.process_time() - began))
        row = "".join(f"{median(taken[name]):15,.0f}" for name in makers)
        print(f"{n:8,}{row}")  # noqa: T201
    if "pyrvo" not in makers:
        print("pyrvo is not installed: not measured beside")  # noqa: T201


def _team(robots: int) -> None:
    """Print how a team on two wheels arrives over the seeds."""
    group = Group(relation="around", targets=("t1",), robots=robots)
    contract = Contract(groups=(group,), robot_radius=RADIUS)
    plan = make_plan(contract, SITE, "bench")
    physics = Physics.model_validate(
        {"drive": "differential", "speed": SPEED, "acceleration": 4 * SPEED, "radius": RADIUS}
        | {"noise": {"actuation": NOISE}}
    )
    solid = SITE.outlines["t1"].filled
    request = FleetRequest(SITE.room, robots, solid=solid, radius=RADIUS)
    ended: list[str] = []
    worst: list[float] = []
    apart: list[float] = []
    for seed in range(SEEDS):
        fleet = SimulatedFleet(set_down(request), physics=physics, seed=seed)
        frames: list[FloatArray] = []
        takes = assign_robots(asyncio.run(fleet.observe()), plan.formation.points).robots
        made = asyncio.run(
            deploy(plan, SITE, fleet, takes, watch=lambda p, f=frames: f.append(points_of(p)))
        )
        ended.append(made.arrival.ended)
        worst.append(max(made.arrival.residual_px))
        apart.append(min(min_spacing(points) for points in frames))
    print(  # noqa: T201
        f"{robots:8} {ended.count('arrived'):>4}/{SEEDS} {median(worst):12.3f} {max(worst):12.3f} "
        f"{min(apart) / (2 * RADIUS):18.2f} {tracking_error(physics):18.2f}"
    )


def main() -> None:
    """Print both tables."""
    _show_steps()
    print(f"\ntwo wheels, {NOISE:.0%} noise, {SEEDS} seeds")  # noqa: T201
    heads = f"{'robots':>8} {'arrived':>7} {'median off':>12} {'worst off':>12}"
    print(f"{heads} {'least apart / 2r':>18} {'tracking error':>18}")  # noqa: T201
    for robots in TEAMS:
        _team(robots)


if __name__ == "__main__":
    main()
