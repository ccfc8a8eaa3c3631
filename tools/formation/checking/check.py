"""The checker: positions against a contract, every violation at once, with numbers.

It measures with exact distances on float polygons and trusts nothing about where the
positions came from. Frame: image pixels, x right, y down; robots count from 1 over all groups.
"""

from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import ArrayLike

from ...errors import InputError
from ...geometry.curves import ROUND_JOIN_DIP, Curve
from ...geometry.interior import coverage_radius, yardstick
from ...geometry.lloyd import cells_of
from ...geometry.outline import FARTHEST, FloatArray, Outline, distances
from ...geometry.sampling import min_spacing, nearest
from ..contract import CENTRE_SHARE, Contract
from ..placement import spacing
from ..placement.caging import escape_proof
from ..placement.figure import figure_of
from ..placement.place import Site, reference_curve, side_direction
from .cage_verdict import judge
from .figure_check import on_figure
from .verdict import TOLERANCE, Audit, Part, Verdict, parts_of

SPACING_SHARE, COVER_SHARE = 0.6, 1.4
"""inside, even: against a Lloyd tessellation of the same region at least this share of its
smallest spacing, at most this multiple of its coverage radius."""
SAMPLED = 7
"""Of the ground the ideal places cover every so-manieth cell is looked at first."""
LINE_SHARE = 0.03
"""How far off a straight line a robot may stand, as a share of the line's length."""


def certify(positions: ArrayLike, contract: Contract, site: Site) -> Verdict:
    """Check positions against a contract whose defaults are written out.

    Args:
        positions: (N, 2) image pixels, robots in order over all groups.
        contract: what they must satisfy.
        site: outlines of every target the contract names, and the picture's size.

    Raises:
        InputError: the positions are no (N, 2) array.
    """
    audit = Audit(site.metres_per_pixel)
    points = np.asarray(positions, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2:
        raise InputError(f"Positions must be (x, y) pairs, shape (N, 2); got {points.shape}.")
    if len(points) != contract.robots:
        text = f"The contract wants {contract.robots} positions; {len(points)} were given."
        audit.whole("count", len(points), contract.robots, text, "robots")
        return audit.verdict()
    for i in np.flatnonzero(~(np.abs(points) <= FARTHEST).all(axis=1)):
        audit.robot("no_place", int(i), 0.0, 0.0, "has a coordinate that is no place in a picture")
    if audit.findings:
        return audit.verdict()
    if len(points) > 1:
        audit.least("min_spacing_px", min_spacing(points))
    _bounds(points, contract, site, audit)
    _crowding(points, contract, audit)
    _keep_out(points, contract, site, audit)
    for part in parts_of(contract, points, site):
        _RULES[part.group.relation](part, audit)
    return audit.verdict()


def _bounds(points: FloatArray, contract: Contract, site: Site, audit: Audit) -> None:
    radius = contract.robot_radius
    far = np.array([site.width - 1 - radius, site.height - 1 - radius])
    room = np.minimum(points - radius, far - points).min(axis=1)
    for i in np.flatnonzero(room < -TOLERANCE):
        text = f"is {-room[i]:.1f} px outside the part of the picture robots may stand in"
        audit.robot("out_of_picture", int(i), -room[i], 0.0, text)


def _crowding(points: FloatArray, contract: Contract, audit: Audit) -> None:
    """Robots whose nearest neighbour is nearer than their group allows, each once."""
    if len(points) < 2:
        return
    least = np.concatenate(
        [np.full(g.robots, g.min_spacing or contract.spacing_floor) for g in contract.groups]
    )
    apart, other = nearest(points, points, 2)
    own = other[:, 1] == np.arange(len(points))  # of robots on one spot any may come first
    partner = np.where(own, other[:, 0], other[:, 1])
    for i in np.flatnonzero(apart[:, 1] < least - TOLERANCE):
        j = partner[i]
        if j > i and partner[j] == i and apart[j, 1] < least[j] - TOLERANCE:
            continue  # told of robot j
        text = f"is {apart[i, 1]:.1f} px from robot {j + 1}; {least[i]:.1f} px or more are needed"
        audit.robot("too_close", int(i), apart[i, 1], least[i], text)


def _keep_out(points: FloatArray, contract: Contract, site: Site, audit: Audit) -> None:
    """No robot stands on what is kept out of, or on what another group stands around."""
    groups = np.repeat(np.arange(len(contract.groups)), [g.robots for g in contract.groups])
    for name in contract.solid_targets:
        owners = [k for k, g in enumerate(contract.groups) if name in g.targets]
        foreign = ~np.isin(groups, owners)  # a group's own rule speaks of its own target
        if not foreign.any():
            continue
        distance = distances(site.outlines[name].filled, points)
        for i in np.flatnonzero(foreign & (distance <= contract.robot_radius)):
            text = f"stands on {name}, which is to be kept free"
            audit.robot("keep_out", int(i), distance[i], contract.robot_radius, text)


def _outside(part: Part, audit: Audit) -> None:
    """Robots stand off the filled outline, their edges within the clearance range.

    At corners the distance to the corner is the upper limit: rounded outlines fall short of it.
    """
    distance = distances(part.outline.filled, part.points)
    clearance = distance - part.radius
    beyond = clearance  # a line beside a side passes its recesses by
    if part.group.relation == "along" and part.group.edges is None:
        beyond = distances(part.outline.envelope, part.points) - part.radius
    least, greatest = part.clearance
    most = (greatest + part.radius) * ROUND_JOIN_DIP - part.radius  # a ring there is a polyline
    audit.least("min_clearance_px", clearance.min())
    audit.greatest("max_clearance_px", clearance.max())
    name = part.group.targets[0]
    for i, (value, far) in enumerate(zip(clearance, beyond, strict=True), start=part.first):
        if distance[i - part.first] <= 0:
            audit.robot("on_target", i, 0.0, least, f"stands on {name}")
        elif value < least - TOLERANCE:
            audit.robot(
                "too_near",
                i,
                value,
                least,
                f"is {value:.1f} px from {name}; {least:.1f} px or more are needed",
            )
        elif far > most + TOLERANCE and part.group.relation != "corners":
            audit.robot(
                "too_far",
                i,
                value,
                greatest,
                f"is {value:.1f} px from {name}; {greatest:.1f} px at most are allowed",
            )


def _around(part: Part, audit: Audit) -> None:
    _outside(part, audit)
    curve = reference_curve(part.group, part.site, part.radius)
    if _nowhere(curve, "the ring", audit):
        return
    if not curve.closed:
        share = curve.length / curve.whole_length
        audit.least("ring_in_picture", share)
        audit.notes.append(
            f"Only {share:.0%} of the ring lies inside the picture; the robots spread over that."
        )
    if part.group.relation == "cage":
        spacing.enclosure(part, curve, audit)
        judge(part, curve, audit)
    if part.group.spacing == "even" and not escape_proof(part.group):
        spacing.evenness(part, curve, audit)


def _nowhere(curve: Curve, name: str, audit: Audit) -> bool:
    """Whether nothing of a curve lies inside the picture, which is a finding."""
    if curve.length > 0:
        return False
    audit.whole("out_of_picture", 0.0, 0.0, f"Nothing of {name} lies inside the picture.")
    return True


def _along(part: Part, audit: Audit) -> None:
    _outside(part, audit)
    curve = reference_curve(part.group, part.site, part.radius)
    if _nowhere(curve, "that side", audit):
        return
    if curve.length < 0.995 * curve.whole_length:
        share = curve.length / curve.whole_length
        audit.notes.append(
            f"Only {share:.0%} of that side lies inside the picture; the robots spread over that."
        )
    if part.group.edges is not None:
        spacing.on_edges(part, part.group.edges, audit)
    else:
        direction = side_direction(part.group, part.outline, part.site)
        spacing.on_side(part, curve, direction, audit)
    if part.group.spacing == "even":
        spacing.evenness(part, curve, audit)


def _shape(part: Part, audit: Audit) -> None:
    shape = part.group.shape
    if shape is None:
        _line(part, audit)
        return
    if not part.group.enters:
        _off_targets(part, audit)
    if shape.where == "inside":
        _within(part, audit)
    elif part.group.clearance is not None:
        clearance = distances(part.outline.filled, part.points) - part.radius
        least, name = part.clearance[0], part.group.targets[0]
        audit.least("min_clearance_px", clearance.min())
        for i in np.flatnonzero(clearance < least - TOLERANCE):
            text = f"is {clearance[i]:.1f} px from {name}; {least:.1f} px or more are needed"
            audit.robot("too_near", part.first + int(i), clearance[i], least, text)
    on_figure(part, figure_of(part.group, shape, part.site, part.radius), audit)


def _off_targets(part: Part, audit: Audit) -> None:
    for name in part.group.targets:
        distance = distances(part.site.outlines[name].filled, part.points)
        for i in np.flatnonzero(distance <= part.radius):
            audit.robot("on_target", part.first + int(i), 0.0, part.radius, f"stands on {name}")


def _line(part: Part, audit: Audit) -> None:
    _off_targets(part, audit)
    if part.group.relation == "shape" and part.group.line is None:
        audit.notes.append("A free shape: bounds, spacing and named targets were checked.")
        return
    curve = reference_curve(part.group, part.site, part.radius)
    if _nowhere(curve, "the line", audit):
        return
    spacing.on_curve(part, curve, max(LINE_SHARE * curve.whole_length, 2.0), "the line", audit)
    if part.group.spacing == "even":
        spacing.evenness(part, curve, audit)


def _corners(part: Part, audit: Audit) -> None:
    _outside(part, audit)
    spacing.corner_matching(part, audit)


def _inside(part: Part, audit: Audit) -> None:
    _within(part, audit)
    if part.group.spacing == "even" and len(part.points) > 1:
        _evenly_inside(part, audit)


def _within(part: Part, audit: Audit) -> None:
    """Every robot as deep inside the target as it must and may be."""
    polygon, name = part.outline.polygon, part.group.targets[0]
    sign = np.where(shapely.intersects_xy(polygon, part.points), 1.0, -1.0)
    depth = sign * distances(polygon.boundary, part.points) - part.radius
    least, greatest = part.clearance
    audit.least("min_clearance_px", depth.min())
    for i in np.flatnonzero(depth < least - TOLERANCE):
        where = "outside" if sign[i] < 0 else f"{depth[i]:.1f} px from the edge of"
        audit.robot(
            "not_inside",
            part.first + int(i),
            depth[i],
            least,
            f"is {where} {name}; it must be {least:.1f} px or more inside",
        )
    for i in np.flatnonzero(depth > greatest + TOLERANCE):
        text = f"is {depth[i]:.1f} px inside {name}; {greatest:.1f} px at most are allowed"
        audit.robot("too_deep", part.first + int(i), depth[i], greatest, text)


def _evenly_inside(part: Part, audit: Audit) -> None:
    margin, depth = (bound + part.radius for bound in part.clearance)
    floor = part.group.min_spacing or 0.0
    region = part.site.visible(part.group.targets[0])
    ideal_apart, ideal = yardstick(region, part.group.robots, margin, depth, floor)
    cells = cells_of(region.polygon, part.group.robots)
    apart, cover = min_spacing(part.points), coverage_radius(region, part.points, cells)
    audit.greatest("coverage_radius_px", cover)
    if ideal_apart:
        audit.least("spacing_ratio", apart / ideal_apart)
    least = SPACING_SHARE * ideal_apart
    most = _uncovered_at_most(cover, region, ideal, cells)
    if apart < least - TOLERANCE:
        audit.whole(
            "uneven",
            apart,
            least,
            f"The closest two robots inside are {apart:.1f} px apart; even spreading "
            f"needs {least:.1f} px or more.",
        )
    if cover > most + TOLERANCE:
        audit.whole(
            "uncovered",
            cover,
            most,
            f"Part of the target is {cover:.1f} px from the nearest robot; even "
            f"spreading allows {most:.1f} px.",
        )


def _uncovered_at_most(
    cover: float, region: Outline, ideal: FloatArray, cells: FloatArray
) -> float:
    """How far ground may be from the nearest robot, px, or less where that suffices.

    A part of the ground is no further from the ideal places than all of it.
    """
    most = np.inf
    for every in (SAMPLED, 1) if len(ideal) else ():
        most = COVER_SHARE * coverage_radius(region, ideal, cells[::every])
        if cover <= most:
            break
    return most


def _centre(part: Part, audit: Audit) -> None:
    outline = part.site.visible(part.group.targets[0])
    distance = np.linalg.norm(part.points - outline.centre, axis=1)
    most = CENTRE_SHARE * outline.size
    audit.greatest("max_from_centre_px", distance.max())
    for i in np.flatnonzero(distance > most + TOLERANCE):
        audit.robot(
            "off_centre",
            part.first + int(i),
            distance[i],
            most,
            f"is {distance[i]:.1f} px from the centre; {most:.1f} px at most are allowed",
        )


_RULES: dict[str, Callable[[Part, Audit], None]] = {
    "around": _around,
    "cage": _around,
    "along": _along,
    "corners": _corners,
    "inside": _inside,
    "between": _line,
    "shape": _shape,
    "centre": _centre,
}
