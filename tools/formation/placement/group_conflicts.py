"""Alternative places for a group whose usual ones are too near to robots of earlier groups.

Even spacing along a curve is preserved: its places are turned or slid along it together.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from ...errors import InputError
from ...geometry.curves import Curve, interpolate
from ...geometry.outline import FloatArray, Outline, outline_of
from ...geometry.sampling import nearest, split
from ..contract import Group
from ..site import PlacementError

PHASES = 24
"""Number of positions along a gap that are tried for the first robot of a curve."""
DISC_SEGMENTS, LEAST_DISC = 8, 0.1
NEARLY = 1 - 1e-6
"""Factor on a required distance, so that rounding is not a conflict."""


@dataclass(frozen=True)
class Stand:
    """A group and its robots' positions, (n, 2), image pixels."""

    group: Group
    points: FloatArray


class CrowdedError(PlacementError):
    """Two groups would stand in each other's way.

    Attributes:
        first, second: the groups' indices in the contract, from 0.
    """

    def __init__(self, first: int, second: int, apart: str, need: str) -> None:
        super().__init__(
            f"Robots of group {first + 1} and of group {second + 1} would stand {apart} from each "
            f"other; {need} or more are needed, and no other places were found. Give one of "
            "the groups another clearance, or fewer robots.",
            "crowded",
            groups=[first + 1, second + 1],
        )
        self.first, self.second = first, second


def least_distance(first: Group, second: Group) -> float:
    """Return the least distance between robots of two groups, px."""
    return max(first.min_spacing or 0.0, second.min_spacing or 0.0)


def conflict(stand: Stand, earlier: Sequence[Stand]) -> tuple[int, float, float] | None:
    """Return the first earlier group that a stand comes too near to, or None.

    Returns:
        Its index, the actual distance and the distance needed, px.
    """
    for index, other in enumerate(earlier):
        if not len(other.points) or not len(stand.points):
            continue
        apart = float(nearest(other.points, stand.points, 1)[0].min())
        least = least_distance(stand.group, other.group)
        if apart < least * NEARLY:
            return index, apart, least
    return None


def clear_of_earlier(
    points: FloatArray, group: Group, earlier: Sequence[Stand]
) -> NDArray[np.bool_]:
    """Return a mask (n,) of a group's places (n, 2) far enough from robots of earlier groups."""
    kept = np.ones(len(points), dtype=bool)
    for other in earlier:
        if len(other.points) and len(points):
            kept &= (
                nearest(other.points, points, 1)[0] >= least_distance(group, other.group) * NEARLY
            )
    return kept


def shifted_places(curve: Curve, n: int) -> Iterator[FloatArray]:
    """Yield n places evenly along a curve, starting at one phase of a gap after another."""
    if curve.length <= 0:
        return
    cut = None if curve.closed else curve.cut(n)
    for phase in (np.arange(PHASES) + 0.5) / PHASES:
        if cut is not None:  # the cut stays within a gap
            step = (curve.length + cut) / n
            yield interpolate(curve.lines[0], step * np.arange(n) + phase * (step - cut))
            continue
        lengths = np.array([np.linalg.norm(np.diff(x, axis=0), axis=1).sum() for x in curve.lines])
        shares = split(lengths, n)
        yield np.concatenate(
            [
                interpolate(line, (np.arange(k) + phase) * length / k)
                for line, length, k in zip(curve.lines, lengths, shares, strict=True)
                if k
            ]
        )


def region_left_by(
    outline: Outline, group: Group, earlier: Sequence[Stand], margin: float
) -> Outline | None:
    """Return what the robots of earlier groups leave of a region; None if nothing is left.

    Args:
        outline: the region.
        group: the group to place in it.
        earlier: the groups placed before.
        margin: distance that will be kept from the edge of what is left, px.
    """
    discs = [
        shapely.buffer(
            shapely.multipoints(other.points),
            max(least_distance(group, other.group) - margin, LEAST_DISC),
            quad_segs=DISC_SEGMENTS,
        )
        for other in earlier
        if len(other.points)
    ]
    try:
        return outline_of(
            outline.polygon.difference(shapely.union_all(np.asarray(discs, dtype=object)))
        )
    except InputError:
        return None
