"""Checks from a motion alone whether robots that follow it keep apart and off obstacles.

It shares nothing with the planner. Closest approaches are exact, from the times of the motion; that
the order of passage keeps robots apart when they are late is checked at points along the paths.
"""

from collections.abc import Mapping
from typing import Literal

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from ..formation.value import Value
from ..geometry.outline import FloatArray
from .motion import Indices, Motion, Passages, arc_lengths, as_line

ROUNDING = 1e-6
"""Distances may fall short of what is demanded by so much, px."""
AS_NEAR = 0.98
"""Robots that start or end too near to an obstacle may come to this share of that distance."""
DETOUR = 3.0
"""Robots that start or end too near to an obstacle may stay so for at most so many times the sum of
the shortest way out and a radius."""
FINDINGS = 12
"""Most findings of a kind."""
SAMPLE_SHARE, MOST_SAMPLES = 0.25, 60_000
"""Paths are sampled at this share of the demanded distance, more coarsely if that would take more
points than this."""


class MotionFinding(Value):
    """What keeps a motion from being certified."""

    kind: Literal["separation", "clearance", "passage"]
    robots: tuple[str, ...]
    value: float
    limit: float
    sentence: str


class MotionVerdict(Value):
    """The certificate of a motion.

    Attributes:
        separation_px: least distance of two robots' centres on the way; None for one robot.
        demanded_px: what it may not fall below: two radii, or as near as they start or end.
        clearance_px: least distance of a robot's centre to an obstacle, leaving and entering aside;
            None where there is none.
        makespan_s: until the last robot arrives if nothing delays any.
        longest_px: the longest way.
        waits: how often a robot has to let another one pass.
    """

    certified: bool
    findings: tuple[MotionFinding, ...] = ()
    separation_px: float | None = None
    demanded_px: float = 0.0
    clearance_px: float | None = None
    makespan_s: float = 0.0
    longest_px: float = 0.0
    waits: int = 0


def check_motion(
    motion: Motion,
    radius: float,
    demanded: float,
    obstacles: Mapping[str, BaseGeometry],
    idle: Mapping[str, tuple[float, float]],
) -> MotionVerdict:
    """Certify a motion, or find every robot that comes too near.

    Args:
        radius: of a robot, px.
        demanded: least distance of two robots' centres, px.
        obstacles: what no robot may touch, by name.
        idle: where robots stand that do not move, by id.
    """
    closest, near = _closest_approach(motion, idle, demanded)
    clearance, touched = _clearances(motion, radius, obstacles)
    unordered = _unordered(motion, demanded)
    lengths = [float(arc_lengths(path)[-1]) for path in motion.paths.values()]
    rows = motion.passages
    waits = {*zip(rows.waiting.tolist(), rows.first.tolist(), strict=True)}
    findings = (*near, *touched, *unordered)
    return MotionVerdict(
        certified=not findings,
        findings=findings,
        separation_px=None if closest is None else round(closest, 3),
        demanded_px=round(demanded, 3),
        clearance_px=None if clearance is None else round(clearance, 3),
        makespan_s=round(motion.makespan, 3),
        longest_px=round(max(lengths, default=0.0), 3),
        waits=len(waits),
    )


class _Pieces:
    """The straight pieces of all robots' ways, as (k,) arrays."""

    def __init__(self, motion: Motion, idle: Mapping[str, tuple[float, float]]) -> None:
        end = motion.makespan + 1.0
        begins: list[FloatArray] = []
        spans: list[FloatArray] = []
        for robot, path in motion.paths.items():
            times = motion.times[robot]
            points = np.concatenate([path, path[-1:]])
            when = np.append(times, end)
            begins.append(np.concatenate([points[:-1], points[1:]], axis=1))
            spans.append(np.stack([when[:-1], when[1:]], axis=1))
        for place in idle.values():
            begins.append(np.array([[*place, *place]], dtype=float))
            spans.append(np.array([[0.0, end]]))
        self.ids = (*motion.paths, *idle)
        self.robot = np.repeat(np.arange(len(self.ids)), [len(s) for s in spans])
        ways = np.concatenate(begins)
        self.begin, self.end = ways[:, :2], ways[:, 2:]
        self.span = np.concatenate(spans)

    def approach(self, pairs: Indices) -> FloatArray:
        """Return the least distance of pieces at one time, (p,) px; infinite if they share none."""
        one, other = pairs.T
        lo = np.maximum(self.span[one, 0], self.span[other, 0])
        hi = np.minimum(self.span[one, 1], self.span[other, 1])
        apart, drift = self.at(one, lo) - self.at(other, lo), self._speed(one) - self._speed(other)
        square = np.einsum("ij,ij->i", drift, drift)
        towards = -np.einsum("ij,ij->i", apart, drift)
        after = np.divide(towards, square, out=np.zeros_like(square), where=square > 0)
        after = np.clip(after, 0.0, np.maximum(hi - lo, 0.0))
        found = np.linalg.norm(apart + after[:, None] * drift, axis=1)
        return np.where(hi >= lo, found, np.inf)

    def at(self, piece: Indices, time: FloatArray) -> FloatArray:
        """Return where robots are at a time during a piece, (p, 2) px."""
        return self.begin[piece] + (time - self.span[piece, 0])[:, None] * self._speed(piece)

    def _speed(self, piece: Indices) -> FloatArray:
        way = self.end[piece] - self.begin[piece]
        takes = np.diff(self.span[piece], axis=1)
        return np.divide(way, takes, out=np.zeros_like(way), where=takes > 0)


def _closest_approach(
    motion: Motion, idle: Mapping[str, tuple[float, float]], demanded: float
) -> tuple[float | None, tuple[MotionFinding, ...]]:
    """Return the least distance of two robots, px, and who comes too near."""
    if len(motion.paths) + len(idle) < 2 or not motion.paths:
        return None, ()
    pieces = _Pieces(motion, idle)
    ways = np.stack([pieces.begin, pieces.end], axis=1)
    lines = [as_line(way) for way in ways]
    tree = shapely.STRtree(lines)
    reach = 2 * demanded
    while True:
        pairs = tree.query(lines, predicate="dwithin", distance=reach).T
        pairs = pairs[pieces.robot[pairs[:, 0]] < pieces.robot[pairs[:, 1]]]
        approach = pieces.approach(pairs)
        closest = float(approach.min(initial=np.inf))
        if closest <= reach or len(pairs) == len(ways) * (len(ways) - 1) // 2 or reach > 1e5:
            break
        reach *= 4
    who = pieces.robot[pairs]
    both_idle = (who >= len(motion.paths)).all(axis=1)
    bad = np.flatnonzero((approach < demanded - ROUNDING) & ~both_idle)
    worst: dict[tuple[int, int], float] = {}
    for row in bad:
        key = (int(who[row, 0]), int(who[row, 1]))
        worst[key] = min(worst.get(key, np.inf), float(approach[row]))
    ranked = sorted(worst.items(), key=lambda item: item[1])[:FINDINGS]
    found = tuple(
        MotionFinding(
            kind="separation",
            robots=(pieces.ids[i], pieces.ids[j]),
            value=round(value, 3),
            limit=round(demanded, 3),
            sentence=f"Robots {pieces.ids[i]} and {pieces.ids[j]} would come within {value:.2f} px "
            f"of each other on the way; {demanded:.2f} px are needed.",
        )
        for (i, j), value in ranked
    )
    return (closest if np.isfinite(closest) else None), found


def _clearances(
    motion: Motion, radius: float, obstacles: Mapping[str, BaseGeometry]
) -> tuple[float | None, tuple[MotionFinding, ...]]:
    """Return how near robots come to obstacles, px, and who touches one."""
    least, found = np.inf, list[MotionFinding]()
    for name, region in obstacles.items():
        if region.is_empty:
            continue
        for robot, path in motion.paths.items():
            way = as_line(path)
            near = float(region.distance(way))
            if near < radius - ROUNDING:
                near = _in_passing(way, region, radius)
            least = min(least, near)
            if near >= radius - 10 * ROUNDING:
                continue
            found.append(
                MotionFinding(
                    kind="clearance",
                    robots=(robot,),
                    value=round(near, 3),
                    limit=round(radius, 3),
                    sentence=f"Robot {robot} would come within {near:.2f} px of {name} on the way; "
                    f"its radius is {radius:.2f} px.",
                )
            )
    found.sort(key=lambda finding: finding.value)
    return (None if np.isinf(least) else least), tuple(found[:FINDINGS])


def _in_passing(way: BaseGeometry, region: BaseGeometry, radius: float) -> float:
    """Return how near a way comes to a region, px, aside from leaving and entering its vicinity.

    A way that starts or ends nearer than is allowed is only leaving or entering while it comes
    hardly nearer than there and goes out or in by nearly the shortest way.
    """
    least, body = np.inf, region.buffer(radius - ROUNDING)
    for part in _pieces_of(shapely.intersection(way, body)):
        near = float(region.distance(part))
        ends = [end for end in _ends(way) if part.distance(end) < ROUNDING]
        out = sum(float(body.boundary.distance(end)) for end in ends)
        allowed = min((float(region.distance(end)) for end in ends), default=np.inf)
        if near < AS_NEAR * allowed or part.length > DETOUR * (out + radius):
            least = min(least, near)
    return least


def _pieces_of(geometry: BaseGeometry) -> list[BaseGeometry]:
    parts = shapely.get_parts(geometry)
    return [part for part in parts if not part.is_empty]


def _ends(way: BaseGeometry) -> list[Point]:
    points = shapely.get_coordinates(way)
    return [Point(points[0]), Point(points[-1])]


def _unordered(motion: Motion, demanded: float) -> tuple[MotionFinding, ...]:
    """Return the pairs of robots that could touch if one of them were late."""
    from scipy.spatial import cKDTree

    lengths = [float(arc_lengths(path)[-1]) for path in motion.paths.values()]
    step = max(SAMPLE_SHARE * demanded, sum(lengths) / MOST_SAMPLES)
    along = [np.append(np.arange(0.0, length, step), length) for length in lengths]
    points = [_points(p, s) for p, s in zip(motion.paths.values(), along, strict=True)]
    robot = np.repeat(np.arange(len(along)), [len(s) for s in along])
    tree = cKDTree(np.concatenate(points))
    pairs = tree.query_pairs(demanded - ROUNDING, output_type="ndarray")
    pairs = pairs[robot[pairs[:, 0]] != robot[pairs[:, 1]]]
    s = np.concatenate(along)
    one, other = pairs.T
    kept = _is_held_back(motion.passages, robot[one], s[one], robot[other], s[other])
    kept = kept | _is_held_back(motion.passages, robot[other], s[other], robot[one], s[one])
    ids = list(motion.paths)
    loose = sorted({(int(min(i, j)), int(max(i, j))) for i, j in robot[pairs[~kept]]})[:FINDINGS]
    return tuple(
        MotionFinding(
            kind="passage",
            robots=(ids[i], ids[j]),
            value=0.0,
            limit=round(demanded, 3),
            sentence=f"Robots {ids[i]} and {ids[j]} could touch if one of them were late: nothing "
            "says which goes first.",
        )
        for i, j in loose
    )


def _is_held_back(
    rows: Passages, waiting: Indices, at: FloatArray, first: Indices, past: FloatArray
) -> NDArray[np.bool_]:
    """Return whether a robot is held before a point until another has passed a point of its own.

    The arguments are (p,) columns, and so is the result, which is boolean.
    """
    if not len(rows):
        return np.zeros(len(waiting), dtype=bool)
    count = 1 + max(int(column.max(initial=0)) for column in (rows.first, first))
    pair = rows.waiting * count + rows.first
    rank = np.lexsort((rows.at, pair))
    pair, entry, exit_ = pair[rank], rows.at[rank], rows.past[rank]
    span = float(max(rows.at.max(), at.max(initial=0.0))) + 1.0
    key = pair * span + entry
    wanted = waiting * count + first
    row = np.searchsorted(key, wanted * span + at, side="right") - 1
    return (row >= 0) & (pair[row] == wanted) & (exit_[row] > past)


def _points(path: FloatArray, along: FloatArray) -> FloatArray:
    s = arc_lengths(path)
    return np.stack([np.interp(along, s, path[:, axis]) for axis in (0, 1)], axis=1)
