"""Steps robots through simulated time: what they are told, what they do, where they are seen.

Nothing here waits: whoever steps it keeps the clock. Robots are driven on what is sensed alone.
Frame: image pixels. Everything random comes from one seed.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.outline import FloatArray
from ..motion.following import EXACT, NEAR, Following, Indices
from ..motion.motion import Motion
from .physics import Physics, Spell, braking_speed

PERIOD = 0.05
"""Seconds of simulated time a step takes."""
KEPT = 0.1
"""How far from its path a robot may be taken by a bend that it does not stop at, px."""
SETTLED = 0.25
"""A robot has come to its end within so many px, beside the noise."""
CALM = 0.1
"""Seconds over which robots make up for being off their path where sensing is noisy."""
LOOK_AHEAD = 4
"""Steps ahead on its path that a robot with wheels steers for, at least its radius."""
ASKEW, MOST_ASKEW = 0.04, 0.3
"""A robot with wheels that looks so many radians past its way turns before it drives on; where
sensing is noisy more, at most the second."""
LOOKING = 0.01
"""A robot looks where it is to within so many radians."""
SPREAD = 5.0
"""Standard deviations that noise is taken to stay within."""

Mask = NDArray[np.bool_]


def tracking_error(physics: Physics) -> float:
    """How far from its path a robot may come that nothing pushes, px.

    A drift of noise is made up for over some seconds, in which it adds up as a random walk does.
    """
    noise, wheels = physics.noise, physics.drive == "differential"
    kept = (KEPT + NEAR) * (2 if wheels else 1) * (2 if physics.drop_outs else 1)
    seconds = PERIOD * (_smoothing(physics) + physics.delay)
    drift = noise.actuation * physics.speed * math.sqrt(seconds) * (1.5 if wheels else 1.0)
    late = (noise.actuation + physics.slip) * physics.speed * physics.delay
    return kept + SPREAD * (noise.sensing + drift) + late


def _smoothing(physics: Physics) -> float:
    """Seconds over which robots make up for being off their path."""
    return PERIOD + (CALM if physics.noise.sensing else 0.0)


@dataclass(frozen=True)
class _Seen:
    """Robots of a drive as their controllers see them; rows are theirs.

    Attributes:
        points, headings: where they will be when what they are told now takes effect.
        rates: what they were told last.
        room: px that they may still go along their paths.
        along: unit vectors of their legs, zero at the end.
        off: (n, 2) from where they should be to where they are, px.
        aims: points on the lines of their legs that they steer for.
        looks: how they are to look at the end; nan for any way.
    """

    points: FloatArray
    headings: FloatArray
    rates: FloatArray
    room: FloatArray
    along: FloatArray
    off: FloatArray
    aims: FloatArray
    looks: FloatArray


class Simulator:
    """Robots on a plane, from step to step.

    Args:
        ids: of the robots.
        points: (n, 2) where they stand, px.
        headings: (n,) radians; nan where they have none.
        now: the time, seconds.

    Attributes:
        points, headings: as they truly are.
        velocities: (n, 2) px per second, without what slips.
        sensed: (n, 2) where they were seen last.
        seen: (n,) when that was.
    """

    def __init__(
        self,
        ids: Sequence[str],
        points: FloatArray,
        headings: FloatArray,
        physics: Physics,
        *,
        seed: int = 0,
        now: float = 0.0,
    ) -> None:
        self.ids, self.physics, self.now = tuple(ids), physics, now
        self.points, self.headings = points.copy(), headings.copy()
        self._wheels = physics.drive == "differential"
        if self._wheels:
            self.headings = np.nan_to_num(self.headings)
        self._begun = now
        self._random = np.random.default_rng(seed)
        n = len(self.ids)
        self.velocities, self._rates = np.zeros((n, 2)), np.zeros((n, 2))
        self._grip = 1 - physics.slip * self._random.random(n)
        self._smoothing = _smoothing(physics)
        unsure = SPREAD * physics.noise.sensing / physics.radius
        self._askew = min(ASKEW + unsure, MOST_ASKEW)
        # Along the way and across it, or on and about: together within the limit.
        self._push = physics.acceleration * (0.5 if self._wheels else math.sqrt(0.5))
        row = {robot: i for i, robot in enumerate(self.ids)}
        self._stuck, self._lost = (
            [(row[s.robot], s) for s in spells] for spells in (physics.stuck, physics.lost)
        )
        self._pushes = [(row[p.robot], p) for p in physics.pushes]
        self.sensed, self.seen = points.copy(), np.full(n, now)
        self._sense(np.zeros(n, dtype=bool))
        self._rows: Indices = np.empty(0, dtype=np.intp)
        self._following: Following | None = None

    def begin(self, motion: Motion) -> None:
        """Take up a motion of some of the robots; the others stay."""
        row = {robot: i for i, robot in enumerate(self.ids)}
        self._rows = np.array([row[robot] for robot in motion.paths], dtype=np.intp)
        self._following = Following(motion)
        n = len(self._rows)
        self._progress, self._ahead = np.zeros(n), np.zeros(n)
        self._stops = self._following.stops(self._rooms(self._following))
        looks = [motion.headings.get(robot, math.nan) for robot in motion.paths]
        self._looks = np.array(looks)
        self._told = np.zeros((n, 2))
        self._queue = deque([self._told] * round(self.physics.delay / PERIOD))
        self._there = np.zeros(n, dtype=bool)

    def accompany(self, ids: Sequence[str]) -> None:
        """Keep up with places that move, which `step` is told: these robots; the others stay."""
        where = {robot: self.points[self.ids.index(robot)] for robot in ids}
        self.begin(Motion({robot: np.stack([point, point]) for robot, point in where.items()}))
        self._following = None

    def hold(self) -> None:
        """Stand, at once."""
        self._following = None
        self.velocities[:], self._rates[:] = 0.0, 0.0

    @property
    def arrived(self) -> bool:
        """Whether all robots that drive were seen at their ends."""
        return bool(self._there.all())

    def step(self, places: FloatArray | None = None) -> None:
        """Let a step of time pass.

        Args:
            places: where robots that `accompany` are to be now, (n, 2) px, and beside it with what
                velocity, (n, 2) px per second.
        """
        self.now += PERIOD
        if places is not None:
            self._tell(self._kept_up(places))
        elif self._following is not None:
            seen = self._seen(self._following)
            self._mark(seen)
            self._tell(self._steered(seen) if self._wheels else self._pulled(seen))
        for i, push in self._pushes:
            if self.now - PERIOD < self._begun + push.at <= self.now:
                self.points[i] += push.by
        self._sense(self._random.random(len(self.ids)) < self.physics.drop_outs)

    def _tell(self, told: FloatArray) -> None:
        """Send robots what they are told; those that are not seen slow down."""
        unseen = self.seen[self._rows] < self.now - 1.5 * PERIOD
        told[unseen] = self._changed(self._told[unseen], np.zeros((unseen.sum(), 2)))
        self._told = told
        self._queue.append(told)
        self._move(self._rows, self._queue.popleft())

    def _rooms(self, following: Following) -> FloatArray:
        """Px in which robots that pass a vertex as fast as they may can stop.

        They stop at it unless what they cut off, or are carried past it, in a step is within KEPT.
        """
        change = min(KEPT / PERIOD, self._push * PERIOD)
        legs = np.minimum(following.legs_before, np.roll(following.legs_before, -1))
        turned = np.maximum(2 * np.sin(following.turns / 2), 1e-9)
        fast = np.minimum(change / turned, np.sqrt(change / PERIOD * legs / turned))
        fast = np.minimum(fast, self.physics.speed)
        if self._wheels:  # what steering ahead cuts off bends one after another stays within KEPT
            about = braking_speed(np.array([KEPT / 2]), self._push, PERIOD) / self.physics.radius
            fast = np.minimum(fast, about * legs / turned)
        fast[fast < self._push * PERIOD] = 0.0
        return np.maximum(fast**2 / (2 * self._push) - fast * PERIOD / 2, 0.0)

    def _seen(self, following: Following) -> _Seen:
        rows, rates = self._rows, self._told
        points, headings = self._expected()
        queued = np.zeros(len(rows))
        for told in self._queue:
            queued += PERIOD * (abs(told[:, 0]) if self._wheels else _norms(told))
        fresh = self.seen[rows] >= self.now - 1.5 * PERIOD
        near = NEAR + 2 * self.physics.noise.sensing
        ahead = following.advance(points, self._ahead, near)
        self._ahead = ahead = np.where(fresh, ahead, self._ahead)
        progress = np.maximum(self._progress, ahead - queued)
        self._progress = np.where(fresh, progress, self._progress)
        along, off = following.directions(ahead), points - following.at(ahead)
        room = np.minimum(
            following.limits(self._progress) - ahead, following.room(ahead, self._stops)
        )
        room = np.maximum(room - np.einsum("ij,ij->i", off, along), 0.0)
        reach = abs(rates[:, 0]) * LOOK_AHEAD * PERIOD
        reach = np.maximum(reach, self.physics.radius)
        aims = following.at(ahead) + along * reach[:, None]
        return _Seen(points, headings, rates, room, along, off, aims, self._looks)

    def _expected(self) -> tuple[FloatArray, FloatArray]:
        """Where robots are, and look, when what they are told now takes effect."""
        points, headings = self.sensed[self._rows], self.headings[self._rows]
        for told in self._queue:
            points, headings = self._carried(points, headings, told)
        return points, headings

    def _kept_up(self, places: FloatArray) -> FloatArray:
        """What robots are told so that they move as their places do, and come back onto them."""
        (points, headings), most = self._expected(), self.physics.speed
        off = points - places[:, :2] - PERIOD * len(self._queue) * places[:, 2:]
        size = _norms(off)
        back = braking_speed(size, self._push, self._smoothing)
        told = places[:, 2:] - off * _ratio(back, size)[:, None]
        told *= np.minimum(_ratio(most, _norms(told)), 1.0)[:, None]
        if not self._wheels:
            return told
        fast, radius = _norms(told), self.physics.radius
        turn = _wrapped(np.arctan2(told[:, 1], told[:, 0]) - headings)
        back_first = abs(turn) > np.pi / 2
        turn = _wrapped(turn + np.pi * back_first) * (fast >= self._push * PERIOD / 4)
        arc = np.asarray(abs(turn) * radius, dtype=float)
        about = np.minimum(braking_speed(arc, self._push, self._smoothing), most / 2) * np.sign(
            turn
        )
        fast = np.minimum(fast, most - abs(about)) * np.clip(np.cos(2 * turn), 0.0, 1.0)
        return np.stack([np.where(back_first, -fast, fast), about / radius], axis=1)

    def _mark(self, seen: _Seen) -> None:
        """Note who is at the end; noise does not take robots from it, a push does."""
        assert self._following is not None
        noise, off = self.physics.noise.sensing, _norms(seen.off)
        ended = self._progress >= self._following.lengths - EXACT
        still = _wrapped(seen.looks - self.headings[self._rows])  # not as they will look
        turned = np.isnan(still) | (abs(still) <= LOOKING)
        slow = _norms(seen.rates) <= self._push * PERIOD
        self._there &= off <= SETTLED + 2 * SPREAD * noise
        self._there |= ended & turned & slow & (off <= SETTLED + 3 * noise)

    def _pulled(self, seen: _Seen) -> FloatArray:
        """Velocities that points are told: along the way, and across it back onto it."""
        most, change = self.physics.speed, self._push * PERIOD
        before = np.einsum("ij,ij->i", seen.rates, seen.along)
        across = seen.rates - before[:, None] * seen.along
        size = _norms(seen.off)
        back = np.minimum(braking_speed(size, self._push, self._smoothing), most / 2)
        wanted = -seen.off * _ratio(back, size)[:, None]
        wanted -= np.einsum("ij,ij->i", wanted, seen.along)[:, None] * seen.along
        across = self._changed(across, wanted)
        fast = np.minimum(braking_speed(seen.room, self._push, self._smoothing), most)
        fast = np.clip(fast, before - change, before + change)
        told = fast[:, None] * seen.along + across
        return told * np.minimum(_ratio(most, _norms(told)), 1.0)[:, None]

    def _steered(self, seen: _Seen) -> FloatArray:
        """Speeds on and about that robots with wheels are told, px and radians per second."""
        radius, most, change = self.physics.radius, self.physics.speed, self._push * PERIOD
        ended, size = _norms(seen.along) == 0.0, _norms(seen.off)
        settled = ended & (size <= SETTLED + 3 * self.physics.noise.sensing)
        aim = np.where(ended[:, None], -seen.off, seen.aims - seen.points)
        turn = _wrapped(np.arctan2(aim[:, 1], aim[:, 0]) - seen.headings)
        looks = np.where(np.isnan(seen.looks), seen.headings, seen.looks)
        turn = np.where(settled, _wrapped(looks - seen.headings), turn)
        turn[~settled & (_norms(aim) < NEAR / 4)] = 0.0
        arc = np.asarray(abs(turn) * radius, dtype=float)
        about = braking_speed(arc, self._push, self._smoothing) * np.sign(turn)
        about = np.clip(about, -most / 2, most / 2)
        before = seen.rates[:, 1] * radius
        about = np.clip(about, before - change, before + change)
        room = np.where(ended, size, seen.room)
        room[settled] = 0.0
        fast = np.minimum(braking_speed(room, self._push, self._smoothing), most - abs(about))
        fast *= np.clip(1 - abs(turn) / self._askew, 0.0, 1.0)
        fast = np.clip(fast, seen.rates[:, 0] - change, seen.rates[:, 0] + change)
        return np.stack([fast, about / radius], axis=1)

    def _changed(self, rates: FloatArray, wanted: FloatArray) -> FloatArray:
        """Rates, (n, 2), as near to those wanted as a step can bring them."""
        most, change = self._push * PERIOD, wanted - rates
        if self._wheels:
            scale = np.array([1.0, self.physics.radius])
            return rates + np.clip(change * scale, -most, most) / scale
        size = _norms(change)
        return rates + change * np.minimum(_ratio(most, size), 1.0)[:, None]

    def _move(self, rows: Indices, told: FloatArray) -> None:
        """What robots do of what they are told."""
        stuck = self._out_of_order(self._stuck)[rows]
        if self._wheels:
            rates = self._changed(self._rates[rows], told)
        else:  # all of the acceleration: across and along have been kept apart
            change = told - self._rates[rows]
            most = self.physics.acceleration * PERIOD
            share = np.minimum(_ratio(most, _norms(change)), 1.0)
            rates = self._rates[rows] + change * share[:, None]
        rates[stuck] = 0.0
        self._rates[rows] = rates
        done = self._noisy(rates) * self._grip[rows, None]
        done[stuck] = 0.0
        self.points[rows], self.headings[rows] = self._carried(
            self.points[rows], self.headings[rows], done, ~stuck
        )
        self.velocities[rows] = rates
        if self._wheels:
            way = self.headings[rows]
            self.velocities[rows] = rates[:, :1] * np.stack([np.cos(way), np.sin(way)], axis=1)

    def _carried(
        self, points: FloatArray, headings: FloatArray, rates: FloatArray, free: Mask | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Where a step at some rates takes robots, and how they look then."""
        if self._wheels:
            turned = rates[:, 1] * PERIOD
            middle = headings + turned / 2
            way = np.stack([np.cos(middle), np.sin(middle)], axis=1)
            return points + rates[:, :1] * PERIOD * way, headings + turned
        if free is not None:  # points turn by the way
            wanted = ~np.isnan(self._looks) & free
            begun = np.nan_to_num(headings[wanted])
            most = self.physics.speed / self.physics.radius * PERIOD
            headings = headings.copy()
            turn = np.clip(_wrapped(self._looks[wanted] - begun), -most, most)
            headings[wanted] = begun + turn
        return points + rates * PERIOD, headings

    def _noisy(self, rates: FloatArray) -> FloatArray:
        """Rates as actuators make them of what they are told; none goes faster than it can."""
        share, most = self.physics.noise.actuation, self.physics.speed
        if not share:
            return rates
        noise = 1 + share * self._random.standard_normal(rates.shape)
        if self._wheels:
            radius = self.physics.radius
            turned = radius * rates[:, 1]
            wheels = np.stack([rates[:, 0] - turned, rates[:, 0] + turned], axis=1)
            left, right = np.clip(wheels * noise, -most, most).T
            return np.stack([(left + right) / 2, (right - left) / (2 * radius)], axis=1)
        askew = noise[:, 1:] - 1
        turned = np.stack([-rates[:, 1], rates[:, 0]], axis=1)
        done = rates * noise[:, :1] + turned * askew
        return done * np.minimum(_ratio(most, _norms(done)), 1.0)[:, None]

    def _sense(self, dropped: Mask) -> None:
        seen = np.flatnonzero(~(dropped | self._out_of_order(self._lost)))
        noise = self.physics.noise.sensing
        self.sensed[seen] = self.points[seen]
        if noise:
            self.sensed[seen] += noise * self._random.standard_normal((len(seen), 2))
        self.seen[seen] = self.now

    def _out_of_order(self, spells: Sequence[tuple[int, Spell]]) -> Mask:
        """Robots that are in such a spell now, (n,)."""
        out, since = np.zeros(len(self.ids), dtype=bool), self.now - self._begun
        for i, spell in spells:
            lasts = math.inf if spell.lasting is None else spell.lasting
            out[i] |= spell.after <= since < spell.after + lasts
        return out


def _norms(vectors: FloatArray) -> FloatArray:
    """Their lengths, (n,)."""
    return np.asarray(np.hypot(vectors[:, 0], vectors[:, 1]))


def _ratio(a: FloatArray | float, b: FloatArray) -> FloatArray:
    """a / b, and 1 where b is 0, (n,)."""
    return np.divide(a, b, out=np.ones(len(b)), where=b > 0)


def _wrapped(angle: FloatArray) -> FloatArray:
    """Angles between -pi and pi, (n,)."""
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
