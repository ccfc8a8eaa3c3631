"""Places robots so that they certainly cage a target, as a contract demands.

Frame: image pixels, x right, y down; a target's holes do not matter to what surrounds it.
"""

import shapely
from shapely.geometry.base import BaseGeometry

from ...geometry.cages.budget import cut_short
from ...geometry.cages.cage_places import Demand, caging_places, fewest_cage
from ...geometry.curves import Curve
from ...geometry.outline import FloatArray
from ..contract import Group
from ..site import PlacementError, Site

CUT_SHORT = " The search was cut short; with fewer groups or robots it goes further."


class CageError(PlacementError):
    """A group's robots cannot be placed so that they certainly cage its target.

    Attributes:
        needed: how many robots would do, or None if no number is known to.
        group: the group.
        fits: how many of the robots have room on the ring if that is fewer than all, else 0.
    """

    def __init__(self, group: Group, needed: int | None, fits: int, site: Site) -> None:
        way = (
            f"{needed} robots would do"
            if needed
            else f"no more than {fits} have room there"
            if fits
            else "no other number is known to do: allow a nearer clearance or take the closure ring"
        )
        super().__init__(
            f"No places were found where {group.robots} robots, {site.length(group.offsets())} "
            f"from {group.targets[0]}, certainly cage it; {way}.{CUT_SHORT if cut_short() else ''}",
            "cage",
            robots_needed=needed,
            robots_that_fit=fits,
        )
        self.needed, self.group, self.fits = needed, group, fits


def escape_proof(group: Group) -> bool:
    """Return whether the group demands a certificate that the target cannot get out."""
    return group.closure == "escape-proof"


def caged_places(group: Group, site: Site, radius: float, curve: Curve) -> FloatArray:
    """Return places that certainly cage the group's target, evenly on the curve if that suffices.

    Raises:
        CageError: none were found; it says how many robots would do, if known.
    """
    demand = demand_of(group, site, radius)
    points = caging_places(demand, group.robots, (curve,))
    if points is None:
        longest = max(c.length for c in (curve, *demand.curves))
        crowded = longest < (group.robots + 1) * demand.spacing
        enough = None if crowded else fewest_cage(demand, group.robots + 1)
        fits = min(int(longest / demand.spacing), group.robots - 1) if crowded else 0
        raise CageError(group, None if enough is None else len(enough), fits, site)
    return points


def demand_of(group: Group, site: Site, radius: float) -> Demand:
    """Return the requirements on a group's cage."""
    return Demand(
        site.outlines[group.targets[0]],
        group.offsets(),
        radius,
        site.frame(radius),
        group.min_spacing or 0.0,
        walls_of(group, site.room),
    )


def walls_of(group: Group, room: tuple[float, float]) -> BaseGeometry | None:
    """Return the picture's border if the contract makes it a wall, else None."""
    if not group.walls:
        return None
    return shapely.box(-0.5, -0.5, room[0] - 0.5, room[1] - 0.5).boundary
