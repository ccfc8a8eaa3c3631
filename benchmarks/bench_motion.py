"""`python -m formup.benchmarks.bench_motion`: plans, certifies and drives motions of seeded scenes.

It compares makespans with a bound that no robots can beat, tries teams of up to 10,000, and robots
that are late or stop for good, and runs pyrvo on the same scenes. Seconds are CPU seconds.
"""

import argparse
import asyncio
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import get_context
from multiprocessing.connection import Connection
from resource import RUSAGE_SELF, getrusage
from statistics import median

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from ..tools.errors import FleetError
from ..tools.fleet.deploy import deploy
from ..tools.fleet.physics import Physics
from ..tools.fleet.simulated import FULL_SPEED_S, SLIP, SimulatedFleet
from ..tools.fleet.simulator import tracking_error
from ..tools.motion.checking import MotionVerdict, check_motion
from ..tools.motion.motion import Motion
from ..tools.motion.planning import plan_motion
from ..tools.motion.routes import way_lengths
from .growth import growth, show
from .motion_late import Late, late
from .motion_orca import orca
from .motion_scenes import RADIUS, SPEED, Scene, scene

PARTS = ("scenes", "large", "late", "pyrvo")
SIZES, ORCA_SIZES, LARGE = (8, 30, 100, 300), (8, 30, 100), (300, 1_000, 3_000, 10_000)
LATE_SCENES, LATE_MOST = 2_000, 100
INSIDE = 12
"""A seed whose formation, inside a square, has room for any number of robots."""
MOST_SECONDS = 600.0
"""Longest wall time, in seconds, that a large team may take."""
PHYSICS = Physics(speed=SPEED, acceleration=SPEED / FULL_SPEED_S, radius=RADIUS, slip=SLIP)


@dataclass(frozen=True)
class Planned:
    """A motion with its certificate, the robot of each place, and CPU seconds."""

    motion: Motion
    robots: tuple[str, ...]
    verdict: MotionVerdict
    planning: float
    checking: float


def planned(of: Scene, error: float) -> Planned:
    """Assign robots to the places, plan their motion, and check it.

    Args:
        error: how far robots may deviate from their paths, px.

    Raises:
        FleetError: no motion is found.
    """
    began = time.process_time()
    team = of.team(error)
    motion, robots, verdict = plan_motion(team, of.goals, of.ground, interchangeable=True)
    whole, began = time.process_time() - began, time.process_time()
    check_motion(motion, RADIUS, verdict.demanded_px, of.ground.obstacles, {})
    checking = time.process_time() - began
    return Planned(motion, robots, verdict, whole - checking, checking)


def bound(of: Scene) -> float:
    """Return a lower bound of the makespan, s: the bottleneck assignment over shortest paths."""
    frame = of.site.frame(RADIUS)
    ways = way_lengths(of.starts, of.goals, of.ground.solid, RADIUS, frame)
    lengths = np.unique(ways)
    low, high = 0, len(lengths) - 1
    while low < high:
        middle = (low + high) // 2
        if (maximum_bipartite_matching(csr_array(ways <= lengths[middle])) >= 0).all():
            high = middle
        else:
            low = middle + 1
    return float(lengths[low]) / SPEED


@dataclass(frozen=True)
class Outcome:
    """The result of a scene; `why` says why it failed, or is empty.

    Attributes:
        separation: least distance of robots in the plan, as a fraction of two radii.
        seen: the same, as observed while they drove.
        clearance: least distance from obstacles in the plan, as a fraction of a radius.
        over_bound: makespan as a multiple of `bound`.
        planning: CPU seconds; `checking` likewise.
    """

    why: str
    arrived: bool = False
    separation: float = np.inf
    seen: float = np.inf
    clearance: float = np.inf
    over_bound: float = np.nan
    planning: float = np.nan
    checking: float = np.nan


def measured(of: Scene) -> Outcome:
    """Plan a scene and drive it in the simulator, as a deployment does."""
    try:
        made = planned(of, tracking_error(PHYSICS))
    except FleetError as error:
        return Outcome(f"no motion: {error}")
    verdict = made.verdict
    if not verdict.certified:
        return Outcome(f"not certified: {verdict.findings[0].sentence}")
    fleet = SimulatedFleet(of.poses(), physics=PHYSICS)
    try:
        arrival = asyncio.run(deploy(of.plan, of.site, fleet, made.robots)).arrival
    except FleetError as error:
        return Outcome(f"not driven: {error}")
    off = (np.array(arrival.residual_px) > arrival.tolerance_px).nonzero()[0]
    unnamed = {arrival.robots[i] for i in off} - {*arrival.failed, *arrival.waiting}
    return Outcome(
        f"not named: {arrival.reason}" if unnamed else "",
        arrival.arrived,
        (verdict.separation_px or np.inf) / (2 * RADIUS),
        (arrival.separation_px or np.inf) / (2 * RADIUS),
        (verdict.clearance_px or np.inf) / RADIUS,
        made.motion.makespan / bound(of),
        made.planning,
        made.checking,
    )


def scene_rows(sizes: Sequence[int], seeds: range) -> Iterator[str]:
    """Yield, for each number of robots, how many scenes are complete, and their figures."""
    yield f"{len(seeds)} scenes of each number of robots; figures are medians / worst"
    yield (
        f"{'robots':>6} {'complete':>8} {'arrived':>7} {'apart/2r':>8} {'driven':>6} "
        f"{'off/r':>6} {'makespan/bound':>14} {'planning s':>13} {'checking s':>13}"
    )
    for n in sizes:
        found = {seed: measured(scene(seed, n)) for seed in seeds}
        done = [outcome for outcome in found.values() if not outcome.why]
        if done:
            yield (
                f"{n:6} {len(done):8} {sum(o.arrived for o in done):7} "
                f"{min(o.separation for o in done):8.3f} {min(o.seen for o in done):6.3f} "
                f"{min(o.clearance for o in done):6.3f} "
                f"{_median_and_worst([o.over_bound for o in done]):>14} "
                f"{_median_and_worst([o.planning for o in done]):>13} "
                f"{_median_and_worst([o.checking for o in done]):>13}"
            )
        for seed, outcome in found.items():
            if outcome.why:
                yield f"       {scene(seed, n).name} (seed {seed}): {outcome.why}"


def _median_and_worst(values: Sequence[float]) -> str:
    return f"{median(values):.2f} / {max(values):.2f}"


def _plan_large(robots: int, to: Connection) -> None:
    """Run in a process of its own, and send a team's seconds, MiB and result, or why it failed."""
    of = scene(INSIDE, robots, "random")
    before = getrusage(RUSAGE_SELF).ru_maxrss
    try:
        made = planned(of, tracking_error(PHYSICS))
    except (FleetError, MemoryError) as error:
        to.send(f"{type(error).__name__}: {error}")
        return
    memory = (getrusage(RUSAGE_SELF).ru_maxrss - before) / 1024
    to.send((made.planning, made.checking, memory, made.verdict, made.motion.makespan))


def large_rows(sizes: Sequence[int], most: float = MOST_SECONDS) -> Iterator[str]:
    """Yield teams that start anywhere, once each, and how their time and memory grow."""
    yield f"{'robots':>6} {'planning s':>10} {'checking s':>10} {'MiB':>7} {'apart/2r':>8}"
    figures: dict[int, tuple[float, float, float]] = {}
    for n in sizes:
        context = get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_plan_large, args=(n, theirs))
        process.start()
        theirs.close()
        try:
            found = ours.recv() if ours.poll(most) else f"not planned within {most:.0f} s"
        except EOFError:
            found = "the process ended: out of memory, most likely"
        process.kill()
        process.join()
        if isinstance(found, str):
            yield f"{n:6,} {found}"
            continue
        planning, checking, memory, verdict, makespan = found
        figures[n] = planning, checking, memory
        said = "certified" if verdict.certified else verdict.findings[0].sentence
        yield (
            f"{n:6,} {planning:10.1f} {checking:10.1f} {memory:7.0f} "
            f"{verdict.separation_px / (2 * RADIUS):8.3f}  {said}; makespan "
            f"{makespan * SPEED / verdict.longest_px:.2f} of the longest way's"
        )
    if len(figures) > 1:
        for name, unit, values in zip(
            ("planning", "checking", "memory"),
            ("s", "s", "MiB"),
            zip(*figures.values(), strict=True),
            strict=True,
        ):
            yield growth(name, "robots", [*figures], values, unit)


def late_rows(seeds: range, most: int = LATE_MOST) -> Iterator[str]:
    """Yield how scenes end with robots that are late, and, in every second one, some that stop."""
    ends: list[Late] = []
    failed: list[str] = []
    for seed in seeds:
        random = np.random.default_rng([seed, most])
        robots = round(3 * (most / 3) ** (random.random() ** 2))  # mostly small teams
        try:
            made = planned(scene(seed, robots), tracking_error(PHYSICS))
        except FleetError as error:
            failed.append(f"       {robots} robots, seed {seed}: {error}")
            continue
        stops = 0.1 if seed % 2 else 0.0
        ends.append(late(made.motion, made.verdict.demanded_px, random, stops))
    count = sum(end.robots for end in ends)
    yield f"{len(ends)} scenes, {count:,} robots: {sum(end.stopped for end in ends):,} stopped for"
    yield (
        f"good, {sum(end.arrived for end in ends):,} arrived, {sum(end.named for end in ends):,} "
        f"named with the one they wait for, {sum(end.unnamed for end in ends)} neither;"
    )
    least = np.array([end.least for end in ends])
    touching = int((least < 1 - 1e-6).sum())
    yield f"least distance {least.min():.4f} of what is demanded, {touching} scenes touching"
    yield from failed


def orca_rows(sizes: Sequence[int], seeds: range) -> Iterator[str]:
    """Yield formup and pyrvo on the same scenes, with the same robots and ways to their places."""
    if find_spec("pyrvo") is None:
        yield "pyrvo is not installed: not measured beside"
        return
    yield (
        f"{'robots':>6} {'':8} {'all arrive':>10} {'arrived':>8} {'overlap':>7} {'apart/2r':>8} "
        f"{'makespan/bound':>14} {'CPU s':>13}"
    )
    for n in sizes:
        ours: list[tuple[float, float, float, float]] = []
        theirs: list[tuple[float, float, float, float]] = []
        for seed in seeds:
            of = scene(seed, n)
            try:
                made, least = planned(of, 0.0), bound(of)
            except FleetError:
                ours.append((0.0, np.inf, np.inf, np.nan))
                continue
            apart = (made.verdict.separation_px or np.inf) / (2 * RADIUS)
            spent = made.planning + made.checking
            ours.append((float(made.verdict.certified), apart, made.motion.makespan / least, spent))
            end = orca(of, least)
            theirs.append((end.arrived, end.separation, end.seconds / least, end.spent))
        for name, rows in (("formup", ours), ("pyrvo", theirs)):
            arrived, apart, makespan, spent = zip(*rows, strict=True)
            ended = [m for a, m in zip(arrived, makespan, strict=True) if a == 1.0]
            yield (
                f"{n:6} {name:8} {len(ended):6}/{len(rows):3} {np.mean(arrived):8.1%} "
                f"{sum(a < 1 - 1e-3 for a in apart):7} {min(apart):8.3f} "
                f"{_median_and_worst(ended) if ended else '-':>14} {_median_and_worst(spent):>13}"
            )


def main() -> None:
    """Print the tables that the command line asks for."""
    parser = argparse.ArgumentParser(description="How teams get to their places.")
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; else all of them")
    parser.add_argument("--scenes", type=int, default=100, help="of each number of robots")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--robots", type=int, nargs="+", help="how many, in place of the usual")
    parser.add_argument("--late", type=int, default=LATE_SCENES, help="scenes with late robots")
    chosen = parser.parse_args()
    if unknown := {*chosen.parts} - {*PARTS}:
        parser.error(f"no such table: {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    seeds = range(chosen.first, chosen.first + chosen.scenes)
    rows = {
        "scenes": lambda: scene_rows(chosen.robots or SIZES, seeds),
        "large": lambda: large_rows(chosen.robots or LARGE),
        "late": lambda: late_rows(range(chosen.first, chosen.first + chosen.late)),
        "pyrvo": lambda: orca_rows(chosen.robots or ORCA_SIZES, seeds),
    }
    for part in chosen.parts or PARTS:
        show((f"-- {part}",))
        show(rows[part]())


if __name__ == "__main__":
    main()
