"""A right answer to each turn of a dialogue, by plain geometry on true outlines, for tests.

It knows nothing of contracts: what stands is a ring, a part of one, or a form, with robots by name;
a turn's checks say how it changes. Policies that understand nothing are below.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import shapely
from formup.evals.grading.dialogue import STATUSES, STILL
from formup.evals.grading.dialogue_forms import gaps_around, neighbour_distance, way_of
from formup.evals.grading.dialogue_states import NOTHING, Case, State, case_of, distances_to
from formup.evals.tasks.task import Task, Thing, Turn
from scipy.cluster.vq import kmeans2
from scipy.optimize import linear_sum_assignment
from shapely.geometry import Point, Polygon

Points = Any
DEGREES = {"right": 0.0, "bottom": 90.0, "left": 180.0, "top": 270.0}


@dataclass
class Spec:
    """What stands: who is about which thing, how far, and where the way round is left free."""

    owners: dict[str, list[str]]
    far: float
    form: str = "around"
    free: tuple[float, float] | None = None
    headings: Any = None
    off: tuple[Polygon, ...] = field(default_factory=tuple[Polygon, ...])

    @property
    def names(self) -> list[str]:
        return sorted((r for own in self.owners.values() for r in own), key=int)


def hold(task: Task, answer: Callable[[Turn, Case, int], State]) -> list[tuple[Turn, Case]]:
    """Every turn of a dialogue with the state that somebody brings about."""
    assert task.dialogue is not None
    states, cases = [NOTHING], list[tuple[Turn, Case]]()
    for number, turn in enumerate(task.dialogue.turns, start=1):
        blank = case_of(task.dialogue, tuple(states), NOTHING, task.metres_per_pixel)
        after = answer(turn, blank, number)
        cases.append((turn, replace(blank, after=after)))
        states.append(after)
    return cases


class Reference:
    """Answers the turns of one dialogue, in order."""

    def __init__(self) -> None:
        self.specs: dict[int, Spec] = {}

    def __call__(self, turn: Turn, case: Case, number: int) -> State:
        before = case.before
        spec = self.specs.get(number - 1, Spec({}, 11.0))
        self.specs[number] = spec
        state = replace(before, status=STATUSES[turn.expect][0], message="-", observed=None)
        if turn.expect in STILL:
            told = replace(case, after=state)
            return replace(state, message=message(told, turn.checks.get("says", {})))
        if turn.expect == "go":
            return replace(state, observed=before.positions.copy())
        if turn.expect == "back":
            then = int(turn.checks["turn"])
            self.specs[number] = self.specs[then]
            return replace(case.past[then], status="planned", message="-")
        spec = changed(Spec({}, 11.0) if turn.expect == "plan" else spec, turn.checks, case)
        self.specs[number] = spec
        return built(spec, turn, case, number)


def message(case: Case, wanted: dict[str, Any]) -> str:
    """A sentence with the numbers that are asked for."""
    found = [f"{word}" for word in wanted.get("words", ())]
    found += ["It is closed." if wanted["closed"] else "No."] if "closed" in wanted else []
    points = case.after.positions
    if "nearest" in wanted:
        far = distances_to(case.things[wanted["nearest"]], points)
        found.append(f"robot {case.after.robots[int(far.argmin())]}")
    if "distance" in wanted:
        far = case.distances(case.after)[list(case.after.robots).index(str(wanted["distance"]))]
        found.append(f"{far:.1f} px")
    if "gap" in wanted:
        wide = max(float(gaps_around(t, ring).chords.max()) for t, ring in case.rings())
        found.append(f"{wide:.1f} px")
    found += [str(len(points))] if "robots" in wanted else []
    return " ".join([*found, str(wanted.get("number", "")), "-"])


def changed(spec: Spec, checks: dict[str, Any], case: Case) -> Spec:
    """What stands after the changes that a turn's checks ask for."""
    new = replace(spec, owners={k: list(v) for k, v in spec.owners.items()})
    _recount(new, checks)
    if "target" in checks:
        _reassign(new, checks["target"], [str(n) for n in checks.get("move", ())])
    new.far = _distance(spec.far, checks, case)
    form, side, gap = checks.get("form"), checks.get("side"), checks.get("opening")
    if form or checks.get("closed") or checks.get("escape_proof"):
        new.form, new.free = form or "around", None
    if gap is not None:
        wide = max(gap.get("least", 0) * 1.35, 2.2 * _even(new, case))
        new.form, new.free = "around", (_towards(gap.get("towards", "top"), new, case), wide)
    if "gap" in checks and new.free is not None:
        new.free = (new.free[0], new.free[1] * (1.5 if checks["gap"] == "wider" else 0.8))
    if side is not None:
        name, _, half = side.partition(" ")
        part = 0.65 if half else 0.85
        new.free = (DEGREES[name] + 180.0, -part)
    if "without" in checks:
        new.free = (DEGREES[checks["without"]], -0.3)
    if "kept_off" in checks:
        new.off = (case.things[checks["kept_off"]].region,)
    new.headings = checks.get("heading", new.headings)
    return new


def _recount(spec: Spec, checks: dict[str, Any]) -> None:
    names, count = spec.names, checks.get("robots")
    wanted = len(names) + {"more": 2, "fewer": -2, "any": 6}.get(str(count), 0)
    wanted = count if isinstance(count, int) else wanted
    gone = {str(name) for name in checks.get("leave", ())}
    gone |= set(names) - {str(n) for n in checks["ids"]} if "ids" in checks else set()
    gone |= set(names[wanted:]) if "leave" not in checks and "ids" not in checks else set()
    for own in spec.owners.values():
        own[:] = [name for name in own if name not in gone]
    last = max(map(int, names), default=0)
    added = [str(last + i) for i in range(1, wanted - len(names) + 1)] if not gone else []
    spec.owners.setdefault(next(iter(spec.owners), "t1"), []).extend(added)


def _reassign(spec: Spec, target: Any, movers: list[str]) -> None:
    names = spec.names
    counts = {target: len(names)} if isinstance(target, str) else dict(target)
    staying = {k: [n for n in own if n not in movers] for k, own in spec.owners.items()}
    owners = {k: staying.get(k, [])[:n] for k, n in counts.items()}
    spare = [name for name in names if not any(name in own for own in owners.values())]
    for thing, count in counts.items():
        missing = count - len(owners[thing])
        owners[thing] = owners[thing] + spare[:missing]
        spare = spare[missing:]
    spec.owners = owners


def _distance(far: float, checks: dict[str, Any], case: Case) -> float:
    asked = checks.get("distance", {})
    wish: dict[str, Any] = {asked: 0.0} if isinstance(asked, str) else asked
    for name, value in wish.items():
        middle = sum(value) / 2 if name == "times" else 1.0
        far = {
            "further": far * 1.3,
            "closer": far * 0.75,
            "same": far,
            "times": far * middle,
            "more": far + value if name == "more" else far,
            "less": far - value if name == "less" else far,
            "px": value,
            "m": value / case.scale if name == "m" and case.scale else far,
            "least": value * 1.15 if name == "least" else far,
            "most": value * 0.85 if name == "most" else far,
        }[name]
    if checks.get("escape_proof"):
        far = 8.0
    return far


def _even(spec: Spec, case: Case) -> float:
    thing, own = next(iter(spec.owners.items()))
    return Polygon(case.things[thing].polygon).buffer(spec.far).length / max(len(own), 1)


def _towards(name: Any, spec: Spec, case: Case) -> float:
    thing = case.things[next(iter(spec.owners))]
    return way_of(name, case, thing.outline.centre)


def built(spec: Spec, turn: Turn, case: Case, number: int) -> State:
    """The state with robots where the spec and the turn's checks want them."""
    before, checks, names = case.before, turn.checks, spec.names
    places = dict(before.at)
    if {"shift", "move", "swap", "at", "mirrored", "size", "turned"} & checks.keys():
        places.update(_carried(spec, checks, case))
        _others(spec, checks, case, places)
    elif checks.get("stay") != "all":
        places = _placed(spec, checks, case)
        for name in checks.get("stay", ()):
            places[str(name)] = before.at[str(name)]
    points = np.array([places[name] for name in names])
    state = State(
        status="planned",
        message="-",
        plan_id=f"p-{number}",
        parent=before.plan_id if turn.expect == "edit" else None,
        robots=tuple(names),
        positions=points,
        certified=True,
        kept_off=spec.off,
    )
    return replace(state, headings=_headings(spec, replace(case, after=state)))


def _others(spec: Spec, checks: dict[str, Any], case: Case, places: dict[str, Any]) -> None:
    """Robots that go to another thing stand beside it; those that are added, beside theirs."""
    for thing, own in spec.owners.items():
        here = case.owners(case.before).get(thing, [])
        new = [name for name in own if name not in here]
        ring = _ring(case.things[thing], max(len(own), 8), spec.far, None)
        for name in new:
            if name in map(str, checks.get("move", own)):
                apart = np.linalg.norm(ring[:, None] - np.array([*places.values()])[None], axis=2)
                places[name] = ring[int(apart.min(1).argmax())]


def _carried(spec: Spec, checks: dict[str, Any], case: Case) -> dict[str, Any]:
    """Robots moved by a map of the plane, or one by one."""
    was = case.before.at
    if "swap" in checks:
        a, b = map(str, checks["swap"])
        return {a: was[b], b: was[a]}
    if "at" in checks:
        return {str(k): np.asarray(v, dtype=float) for k, v in checks["at"].items()}
    points = np.array(list(was.values()))
    middle = points.mean(0)
    if "turned" in checks:
        angle = math.radians(sum(checks["turned"]) / 2)
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        turned = {k: (p - middle) @ turn + middle for k, p in was.items()}
        return _on_ring(spec, turned, case) if "distance" in checks else turned
    if "mirrored" in checks:
        flip = np.array([-1.0, 1.0] if checks["mirrored"] == "left-right" else [1.0, -1.0])
        return {k: (p - middle) * flip + middle for k, p in was.items()}
    wish = checks.get("shift", {})
    named = wish.get("robots", checks.get("move", "all"))
    names = list(was) if named == "all" else [str(n) for n in named]
    if "size" in checks and not wish:
        low, high = checks["size"]
        return {k: (p - middle) * (low + 0.3 * (high - low)) + middle for k, p in was.items()}
    return _shifted(wish, names, case) if wish else {}


def _on_ring(spec: Spec, places: dict[str, Any], case: Case) -> dict[str, Any]:
    """The places of a ring that are nearest to others."""
    way = Polygon(case.things[next(iter(spec.owners))].polygon).buffer(spec.far).exterior
    ways = {k: way.interpolate(way.project(Point(p))) for k, p in places.items()}
    return {k: np.array([p.x, p.y]) for k, p in ways.items()}


def _shifted(wish: dict[str, Any], names: Sequence[str], case: Case) -> dict[str, Any]:
    was = case.before.at
    if "by" in wish:
        return {k: was[k] + np.asarray(wish["by"], dtype=float) for k in names}
    ways = {k: math.radians(way_of(wish["towards"], case, was[k])) for k in names}
    return {k: was[k] + 20 * np.array([math.cos(w), math.sin(w)]) for k, w in ways.items()}


def _placed(spec: Spec, checks: dict[str, Any], case: Case) -> dict[str, Any]:
    """Places for all robots anew, each taken by the robot that has the shortest way."""
    places = dict[str, Any]()
    for thing, own in spec.owners.items():
        if not own:
            continue
        slots = _slots(spec, case.things[thing], len(own), case, checks)
        was = [case.before.at.get(name, slots.mean(0)) for name in own]
        cost = np.linalg.norm(np.array(was)[:, None] - slots[None], axis=2) ** 2
        for robot, slot in zip(*linear_sum_assignment(cost), strict=True):
            places[own[robot]] = slots[slot]
    return places


def _slots(spec: Spec, thing: Thing, count: int, case: Case, checks: dict[str, Any]) -> Points:
    outline = Polygon(thing.polygon)
    if spec.form == "inside":
        box = outline.bounds
        cells = np.stack(np.meshgrid(*(np.linspace(box[i], box[i + 2], 40) for i in (0, 1))), -1)
        cells = cells.reshape(-1, 2)
        cells = cells[shapely.contains_xy(thing.region.buffer(-3), cells)]
        means, _ = kmeans2(cells, count, minit="++", seed=np.random.default_rng(0))
        near = np.linalg.norm(means[:, None] - cells[None], axis=2).argmin(1)
        return cells[near]
    if spec.form == "corners":
        box = shapely.minimum_rotated_rectangle(outline).buffer(4, join_style="mitre")
        return shapely.get_coordinates(box)[:4]
    if spec.form == "between":
        a, b = (np.asarray(t.outline.centre) for t in list(case.things.values())[:2])
        return a + (np.arange(1, count + 1) / (count + 1))[:, None] * (b - a)
    if spec.form == "centre":
        middle = Point(thing.outline.centre).buffer(0.2 * thing.outline.size)
        return _ring(replace(thing, polygon=list(middle.exterior.coords)), count, 0.0, None)
    far = spec.far
    wish = checks.get("spacing")
    if wish:
        was = neighbour_distance(case.before)
        goals = {"wider": 1.3 * was, "tighter": 0.95 * was}
        goal = goals[wish] if isinstance(wish, str) else wish.get("px", 2 * was)
        tried = np.linspace(1, 150, 300)
        off = [abs(_pitch(_ring(thing, count, d, spec.free)) - goal) for d in tried]
        far = spec.far = float(tried[int(np.argmin(off))])
    return _ring(thing, count, far, spec.free)


def _pitch(points: Points) -> float:
    return neighbour_distance(State("planned", robots=("",) * len(points), positions=points))


def _ring(thing: Thing, count: int, far: float, free: tuple[float, float] | None) -> Points:
    """Even places round a thing; `free`: a direction, and how much is left free there.

    That is px, or below zero a share of the way round.
    """
    outline = Polygon(thing.polygon)
    way = outline.buffer(max(far, 0.01)).exterior
    if free is None:
        stations = np.arange(count) / count * way.length
    else:
        angle, wide = math.radians(free[0]), free[1] if free[1] > 0 else -free[1] * way.length
        x, y = thing.outline.centre
        ray = shapely.LineString([(x, y), (x + 1e4 * math.cos(angle), y + 1e4 * math.sin(angle))])
        crossed = shapely.get_coordinates(way.intersection(ray))[-1]
        middle = way.project(Point(crossed))
        start, rest = middle + wide / 2, way.length - wide
        share = np.linspace(0, 1, count) if count > 1 else np.array([0.5])
        stations = (start + share * rest) % way.length
    return shapely.get_coordinates(shapely.line_interpolate_point(way, stations))


def _headings(spec: Spec, case: Case) -> tuple[float | None, ...]:
    wanted = spec.headings
    if wanted is None:
        return ()
    found = list[float]()
    for name in case.after.robots:
        own = next(t for t, of in case.owners(case.after).items() if name in of)
        towards = own if wanted in ("towards", "away") else wanted
        way = way_of(towards, case, case.after.at[name])
        found.append(way + 180 if wanted == "away" else way)
    return tuple(found)


def never_changes(turn: Turn, case: Case, number: int) -> State:
    """Plans once; after that what stands gets another name."""
    if case.before.plan_id is None:
        return Reference()(turn, case, number)
    return _claimed(turn, case, number, case.before)


def starts_over(turn: Turn, case: Case, number: int) -> State:
    """Makes a new ring of eight, whatever is said."""
    spec = Spec({"t1": [str(i) for i in range(1, 9)]}, 11.0)
    made = built(spec, Turn("", "plan"), replace(case, past=(NOTHING,)), number)
    return _claimed(turn, case, number, made)


def jitters(turn: Turn, case: Case, number: int) -> State:
    """Moves every robot a little, whatever is said."""
    if case.before.plan_id is None:
        return Reference()(turn, case, number)
    random = np.random.default_rng(number)
    near = case.before.positions + random.normal(0, 5, case.before.positions.shape)
    return _claimed(turn, case, number, replace(case.before, positions=near))


def _claimed(turn: Turn, case: Case, number: int, state: State) -> State:
    """What somebody made, given out as the very thing that was asked for."""
    return replace(
        state,
        status=STATUSES[turn.expect][0],
        message="Done.",
        plan_id=f"p-{number}",
        parent=case.before.plan_id,
        observed=state.positions if turn.expect == "go" else None,
    )
