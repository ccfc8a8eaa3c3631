"""Whether robots that drive still get on, who stands in the way, and what is said of it."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ..formation.checking.verdict import Verdict
from ..geometry.outline import FloatArray
from ..motion.following import Following
from ..motion.motion import Motion
from .protocol import Pose, points_of

STALLED_S = 3.0
"""A drive ends when no robot has got on for so many seconds on the fleet's clock."""
GOT_ON = 0.5
"""A robot has got on when it is so many px further along its path than ever before."""
MOST_NAMED = 12


class GettingOn:
    """How far the robots of one drive have come, as they were seen.

    Nobody's progress goes back, and every path ends: a drive cannot seem to go on for ever.
    """

    def __init__(self, motion: Motion) -> None:
        self._following = Following(motion)
        n = len(self._following.ids)
        self._progress, self._noted = np.zeros(n), np.zeros(n)
        self._since = np.full(n, np.nan)

    def saw(self, poses: Mapping[str, Pose]) -> bool:
        """Note where robots are; return whether any has got on lately."""
        seen = [poses[robot] for robot in self._following.ids]
        now = max(pose.seen for pose in poses.values())
        self._progress = self._following.advance(points_of(seen), self._progress)
        on = (self._progress > self._noted + GOT_ON) | np.isnan(self._since)
        self._noted[on], self._since[on] = self._progress[on], now
        return bool(now - self._since.max() <= STALLED_S)

    def stuck(self) -> list[str]:
        """Robots that could go on; asked once none has got on lately."""
        free = self._following.limits(self._progress) - self._progress > GOT_ON
        return [self._following.ids[i] for i in np.flatnonzero(free)]

    def waiting(self) -> dict[str, str]:
        """Robots that stand before a passage, and the robot that each waits for."""
        self._following.limits(self._progress)
        return self._following.waits_for(self._progress, GOT_ON)


def said_of(
    failed: Mapping[str, str | None],
    waiting: Mapping[str, str],
    off: Mapping[str, float],
    places: int,
    verdict: Verdict,
) -> str:
    """What is told of a formation that not all robots have come to.

    Args:
        failed: robots that do not move or are gone, with who took their place.
        waiting: robots and the one that each waits for.
        off: px from their places, of the robots that are not there.
        places: how many there are.
        verdict: on what stands.
    """
    told = said_of_replaced(failed)
    still = [robot for robot, other in failed.items() if other is None]
    told += [f"Robot {robot} does not get on{_away(off, robot)}." for robot in still]
    told += [f"Robot {robot} waits for robot {other}." for robot, other in waiting.items()]
    rest = [robot for robot in off if robot not in failed and robot not in waiting]
    told += [f"Robot {robot} is {off[robot]:.1f} px off its place." for robot in rest]
    if len(told) > MOST_NAMED:
        told = [*told[:MOST_NAMED], f"So do {len(told) - MOST_NAMED} more."]
    there = "is certified" if verdict.certified else "is not certified"
    why = "" if verdict.certified else f": {verdict.findings[0].sentence}"
    told.append(f"{places - len(off)} of {places} are at their places; what stands {there}{why}")
    return " ".join(told)


def said_of_replaced(failed: Mapping[str, str | None]) -> list[str]:
    """A sentence for each place that was given to another robot."""
    return [
        f"Robot {other} took the place of robot {robot}, which does not get on."
        for robot, other in failed.items()
        if other is not None
    ]


def nearest_spare(place: FloatArray, spare: Sequence[Pose], but: Collection[str]) -> str | None:
    """The nearest idle robot to a place, (2,), of those that have not failed."""
    left = [pose for pose in spare if pose.id not in but]
    if not left:
        return None
    return left[int(np.argmin(np.linalg.norm(points_of(left) - place, axis=1)))].id


def _away(off: Mapping[str, float], robot: str) -> str:
    return f", {off[robot]:.1f} px from its place" if robot in off else ""
