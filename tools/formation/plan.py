"""A certified formation as a value that can be stored, approved by its id, and deployed.

The id is a hash of where robots would drive and why: positions, contract, robot radius and scene
version. Approving an id approves exactly that; a changed scene voids the plan.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ToolError
from ..geometry.cages.budget import search_budget
from ..geometry.outline import FloatArray
from .checking.check import certify
from .checking.verdict import Verdict
from .contract import Contract, Group, with_defaults
from .headings import headings_of
from .placement.place import Site, place
from .units import length_text
from .value import Value

DECIMALS = 3
"""Positions are rounded to this many decimals of a pixel before they are certified."""

Point = tuple[float, float]


class Formation(Value):
    """N positions in robot order, with the contract they are meant to satisfy.

    Attributes:
        positions: (x, y) px; positions[i] is where robots[i] is to stand.
        robots: ids of the robots in the fleet's order; empty until it is decided who goes where,
            in which case positions are in the order of the contract's groups.
        members: for each group of the contract, the indices of its robots in the order of its
            places; empty while there are no robots.
        headings_deg: for each position the robot's heading, degrees clockwise from the right, or
            None if it has none; empty if the contract names no headings at all.
    """

    positions: tuple[Point, ...]
    contract: Contract
    scene_version: str
    robots: tuple[str, ...] = ()
    members: tuple[tuple[int, ...], ...] = ()
    headings_deg: tuple[float | None, ...] = ()

    @property
    def id(self) -> str:
        """The content hash that names the plan: `p-` and 10 hex digits."""
        return "p-" + _digest(self.model_dump(mode="json"))

    @property
    def points(self) -> FloatArray:
        """The places in the order of the contract's groups, (N, 2), px."""
        points = np.asarray(self.positions, dtype=float).reshape(-1, 2)
        order = [i for group in self.members for i in group]
        return points[order] if order else points

    @property
    def place_headings(self) -> tuple[float | None, ...]:
        """The headings in the order of `points`."""
        order = [i for group in self.members for i in group]
        return tuple(self.headings_deg[i] for i in order if self.headings_deg) or self.headings_deg

    @property
    def robot_of_place(self) -> tuple[str, ...]:
        """Ids of the robots in the order of `points`; numbers from 1 if none were chosen."""
        if not self.robots:
            return tuple(str(i + 1) for i in range(len(self.positions)))
        return tuple(self.robots[i] for group in self.members for i in group)


class Shortfall(Value):
    """What a partial plan falls short of: robots, or the clearance asked for.

    Attributes:
        asked: robots over all groups that were asked for.
        placed: robots that have places.
        clearance_asked: least and greatest that were stated, px, where that is what is missed.
        clearance: the greatest found that can be held instead, px.
        sentence: the same in words.
    """

    asked: int
    placed: int
    clearance_asked: tuple[float, float] | None = None
    clearance: tuple[float, float] | None = None
    sentence: str

    def short(self, metres_per_pixel: float | None) -> str:
        """Return a short text, such as `12 of 30`."""
        if self.clearance is None or self.clearance_asked is None:
            return f"{self.placed} of {self.asked}"
        pair = (self.clearance[0], self.clearance_asked[0])
        held, asked = (length_text(px, metres_per_pixel) for px in pair)
        return f"clearance {held}, not {asked}"


class Plan(Value):
    """A formation with its verdict; only a certified one may be deployed.

    A partial plan is certified for less than was asked for, and names what is missing.
    """

    formation: Formation
    verdict: Verdict
    partial: Shortfall | None = None

    @property
    def id(self) -> str:
        """The content hash of the formation, and for a partial plan also of its shortfall."""
        if self.partial is None:
            return self.formation.id
        content = [self.formation.model_dump(mode="json"), self.partial.model_dump(mode="json")]
        return "p-" + _digest(content)

    def for_robots(self, taking: Sequence[str], fleet: Sequence[str]) -> "Plan":
        """Return the plan with its robots assigned and its positions in the fleet's order.

        Args:
            taking: the id of the robot that takes each place, in the order of the groups.
            fleet: the ids of all robots, in the fleet's order.
        """
        robots = tuple(name for name in fleet if name in set(taking))
        index = {name: i for i, name in enumerate(robots)}
        places = dict(zip(taking, self.formation.points.tolist(), strict=True))
        headings = dict(zip(taking, self.formation.place_headings, strict=False))
        taken = map(index.__getitem__, taking)
        members = tuple(tuple(islice(taken, g.robots)) for g in self.formation.contract.groups)
        formation = self.formation.model_copy(
            update={
                "positions": tuple((x, y) for x, y in map(places.__getitem__, robots)),
                "robots": robots,
                "members": members,
                "headings_deg": tuple(headings[name] for name in robots if headings),
            }
        )
        return self.model_copy(update={"formation": formation})


def make_plan(
    contract: Contract, site: Site, scene_version: str, positions: ArrayLike | None = None
) -> Plan:
    """Fill in the contract's defaults, place the robots unless positions are given, and certify.

    Args:
        contract: the contract, in px.
        site: the outlines and the picture.
        scene_version: version of the scene in which the outlines were measured.
        positions: (N, 2) image pixels, in order over all groups; None to compute them.

    Raises:
        ToolError: the positions are not pairs, or none were given and the contract cannot be met.
    """
    full = with_defaults(contract, site.outlines, site.room)

    def sound(group: Group, places: FloatArray) -> bool:
        return certify(places, full.model_copy(update={"groups": (group,)}), site).certified

    with search_budget():
        points = place(full, site, sound) if positions is None else np.asarray(positions, float)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ToolError(f"Positions must be (x, y) pairs, shape (N, 2); got {points.shape}.")
    rounded = np.round(points, DECIMALS) + 0.0  # + 0.0: no negative zeros
    fits = len(rounded) == full.robots and bool(np.isfinite(rounded).all())
    headings = headings_of(full, rounded, site) if fits else ()
    formation = Formation(
        positions=tuple((float(x), float(y)) for x, y in rounded),
        contract=full,
        scene_version=scene_version,
        headings_deg=headings,
    )
    return Plan(formation=formation, verdict=certify(rounded, full, site, headings))


def _digest(content: Any) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:10]


def scene_version(
    picture_sha256: str, outlines: Mapping[str, object], metres_per_pixel: float | None = None
) -> str:
    """Return a hash of what a certificate depends on: picture, outlines by id, scale if any."""
    scale = () if metres_per_pixel is None else (metres_per_pixel,)
    return "s-" + _digest([picture_sha256, dict(outlines), *scale])
