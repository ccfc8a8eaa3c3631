"""The area in which robots of a group may stand, for display and for dragging robots.

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
    """Return the area in which a group's robots may have their centres; None if it is not an area.

    It follows from the group's clearance and sides; spacing is ignored.
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
    # What lies far outside the picture is never seen, but takes time to compute.
    reach = min(greatest, part.site.width + part.site.height)
    ring = solid.buffer(reach).difference(solid.buffer(least))
    if group.sides is not None:
        return ring.intersection(sides_of(group, part.site))
    curve = curve_of(part) if group.relation == "along" else None
    if curve is None:
        return ring
    return ring.intersection(curve.geometry().buffer(reach, cap_style="flat"))


def curve_of(part: Part) -> Curve | None:
    """Return the curve that the group stands on; None if nothing of it lies in the picture."""
    try:
        curve = reference_curve(part.group, part.site, part.radius)
    except ToolError:
        return None
    return curve if curve.lines else None
