"""Where robots of a group may stand, as an area: to be shown, and for those that are dragged.

Frame: image pixels, x right, y down.
"""

from shapely.geometry import Point
from shapely.geometry.base import BaseGeometry

from ...errors import ToolError
from ...geometry.curves import Curve
from ..contract import CENTRE_SHARE, MAX_LENGTH
from ..placement.place import reference_curve
from ..placement.ring_parts import sides_of
from .verdict import Part


def allowed_area(part: Part) -> BaseGeometry | None:
    """Where the centres of a group's robots may be; None where that is no area.

    It is what the group's clearance and sides leave; spacing is not looked at.
    """
    group, radius = part.group, part.radius
    if group.relation == "centre":
        outline = part.outline
        return Point(outline.centre).buffer(CENTRE_SHARE * outline.size)
    if group.relation == "inside":
        return part.outline.polygon.buffer(-(part.clearance[0] + radius))
    if group.relation not in ("around", "cage", "along") or part.clearance[1] >= MAX_LENGTH:
        return None
    least, greatest = (limit + radius for limit in part.clearance)
    solid = part.outline.filled
    # What lies far outside the picture is never seen, and costs time to make.
    reach = min(greatest, part.site.width + part.site.height)
    ring = solid.buffer(reach).difference(solid.buffer(least))
    if group.sides is not None:
        return ring.intersection(sides_of(group, part.site))
    curve = curve_of(part) if group.relation == "along" else None
    if curve is None:
        return ring
    return ring.intersection(curve.geometry().buffer(reach, cap_style="flat"))


def curve_of(part: Part) -> Curve | None:
    """The curve that the group stands on; None where the picture leaves nothing of it."""
    try:
        curve = reference_curve(part.group, part.site, part.radius)
    except ToolError:
        return None
    return curve if curve.lines else None
