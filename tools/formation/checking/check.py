"""Checks positions against a contract and reports every violation at once, with numbers.

It measures exact distances on float polygons and assumes nothing about how the positions came
about. Frame: image pixels, x right, y down; robots are numbered from 1 over all groups.
"""

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike

from ...errors import InputError
from ...geometry.curves import ROUND_JOIN_DIP, Curve
from ...geometry.interior import coverage_radius, yardstick
from ...geometry.lloyd import cells_of
from ...geometry.outline import FARTHEST, FloatArray, Outline, distances
from ...geometry.sampling import min_spacing, nearest
from ..contract import CENTRE_SHARE, PITCH_PX, Contract
from ..headings import headings_of, off_heading
from ..placement import spacing
from ..placement.caging import escape_proof
from ..placement.figure import drawn_by, figure_of
from ..placement.place import Site, curve_between, reference_curve, side_direction
from . import gaps
from .cage_verdict import judge
from .figure_check import on_figure
from .verdict import TOLERANCE, Audit, Part, Verdict, parts_of

SPACING_SHARE, COVER_SHARE = 0.6, 1.4
"""For an even `inside` group, compared with a Lloyd tessellation of the same region: at least
SPACING_SHARE of its smallest spacing, at most COVER_SHARE times its coverage radius."""
SAMPLED = 7
"""The coverage of the ideal places is first estimated from every 7th cell."""
LINE_SHARE = 0.03
"""How far off a straight line a robot may stand, as a share of the line's length in the picture."""
HEADING_SLACK = 1.0
"""Tolerance on a robot's heading, degrees."""
AT_POINT = 0.5
"""A robot within this distance of a point, px, is at it."""
WHOLE = 0.995
"""A curve does not count as cut if at least this share of it lies in the picture."""


def certify(
    positions: ArrayLike,
    contract: Contract,
    site: Site,
    headings: Sequence[float | None] | None = None,
) -> Verdict:
    """Check positions against a contract whose defaults are filled in.

    Args:
        positions: (N, 2) image pixels, robots in order over all groups.
        contract: with its defaults, in px.
        site: with every target that the contract names.
        headings: headings in the same order, degrees; None to skip their check.

    Raises:
        InputError: the positions are not an (N, 2) array.
    """
    audit = Audit(site.metres_per_pixel)
    points = np.asarray(positions, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2:
        raise InputError(f"Positions must be (x, y) pairs, shape (N, 2); got {points.shape}.")
    if len(points) != contract.robots:
        audit.find("count", len(points), contract.robots, unit="robots")
        return audit.verdict()
    for i in np.flatnonzero(~(np.abs(points) <= FARTHEST).all(axis=1)):
        audit.find("no_place", robot=i)
    if audit.findings:
        return audit.verdict()
    if len(points) > 1:
        audit.least("min_spacing_px", min_spacing(points))
    _check_bounds(points, contract, site, audit)
    _check_crowding(points, contract, audit)
    _check_keep_out(points, contract, site, audit)
    for part in parts_of(contract, points, site):
        _RULES[part.group.relation](part, audit)
    if headings is not None:
        _check_headings(headings, headings_of(contract, points, site), audit)
    return audit.verdict()


def _check_headings(
    headings: Sequence[float | None], wanted: Sequence[float | None], audit: Audit
) -> None:
    for i, angle in enumerate(wanted):
        has = headings[i] if i < len(headings) else None
        off = 0.0 if angle is None else 180.0 if has is None else off_heading(has, angle)
        if off > HEADING_SLACK:
            audit.find("wrong_heading", off, HEADING_SLACK, robot=i, unit="degrees")


def _check_bounds(points: FloatArray, contract: Contract, site: Site, audit: Audit) -> None:
    radius = contract.robot_radius
    far = np.array([site.width - 1 - radius, site.height - 1 - radius])
    room = np.minimum(points - radius, far - points).min(axis=1)
    for i in np.flatnonzero(room < -TOLERANCE):
        audit.find("out_of_picture", -room[i], robot=i)


def _check_crowding(points: FloatArray, contract: Contract, audit: Audit) -> None:
    """Report robots whose nearest neighbour is nearer than their group allows, each pair once."""
    if len(points) < 2:
        return
    least = np.concatenate(
        [np.full(g.robots, g.min_spacing or contract.spacing_floor) for g in contract.groups]
    )
    apart, other = nearest(points, points, 2)
    own = other[:, 1] == np.arange(len(points))  # robots in one spot may come in any order
    partner = np.where(own, other[:, 0], other[:, 1])
    for i in np.flatnonzero(apart[:, 1] < least - TOLERANCE):
        j = partner[i]
        if j > i and partner[j] == i and apart[j, 1] < least[j] - TOLERANCE:
            continue  # reported for robot j
        audit.find("too_close", apart[i, 1], least[i], robot=i, others=(j,))


def _check_keep_out(points: FloatArray, contract: Contract, site: Site, audit: Audit) -> None:
    """Report robots on a keep-out, or on a target of another group that no group enters."""
    groups = np.repeat(np.arange(len(contract.groups)), [g.robots for g in contract.groups])
    for name in contract.solid_targets:
        owners = [k for k, g in enumerate(contract.groups) if name in g.targets]
        foreign = ~np.isin(groups, owners)  # a group's own target is checked by its own rule
        if not foreign.any():
            continue
        plain = contract.model_copy(update={"keep_out_clearance": 0.0})
        distance = distances(site.solid(name, plain), points)
        kept = contract.keep_out_clearance if name in contract.keep_out else 0.0
        least = contract.robot_radius + kept
        near = distance < least - TOLERANCE if kept else distance <= least
        for i in np.flatnonzero(foreign & near):
            off = distance[i] > contract.robot_radius
            kind = "keep_out_near" if off else "keep_out"
            audit.find(kind, distance[i] - off * contract.robot_radius, kept, robot=i, about=name)


def _check_outside(part: Part, audit: Audit) -> None:
    """Check that robots are off the filled outline and their edges within the clearance range.

    At corners the upper limit is the distance to the corner, checked elsewhere, because rounded
    outlines fall short of their corners.
    """
    distance = distances(part.outline.filled, part.points)
    clearance = distance - part.radius
    beyond = clearance
    if part.group.relation == "along" and part.group.edges is None:  # it bridges recesses
        beyond = distances(part.outline.envelope, part.points) - part.radius
    least, greatest = part.clearance
    most = (greatest + part.radius) * ROUND_JOIN_DIP - part.radius  # such a ring is a polyline
    audit.least("min_clearance_px", clearance.min())
    audit.greatest("max_clearance_px", clearance.max())
    name = part.group.targets[0]
    for i, (value, far) in enumerate(zip(clearance, beyond, strict=True), start=part.first):
        if distance[i - part.first] <= 0:
            audit.find("on_target", 0.0, least, robot=i, about=name)
        elif value < least - TOLERANCE:
            audit.find("too_near", value, least, robot=i, about=name)
        elif far > most + TOLERANCE and part.group.relation != "corners":
            audit.find("too_far", value, greatest, robot=i, about=name)


def _check_around(part: Part, audit: Audit) -> None:
    _check_outside(part, audit)
    curve = reference_curve(part.group, part.site, part.radius)
    if _nowhere(curve, "the ring", audit):
        return
    if not curve.closed and not (curve.parted and curve.length >= WHOLE * curve.whole_length):
        audit.least("ring_in_picture", _note_cut(curve, "the ring", audit))
    if part.group.relation == "cage":
        spacing.enclosure(part, curve, audit)
        judge(part, curve, audit)
    if part.group.radius is not None:
        name = f"the circle of radius {part.site.length(part.group.radius)}"
        spacing.on_curve(part, curve.geometry(), PITCH_PX, name, audit)
    if part.group.sides is not None:
        gaps.on_sides(part, audit)
    _check_gaps(part, curve, audit)


def _nowhere(curve: Curve, name: str, audit: Audit) -> bool:
    """Return whether nothing of a curve lies inside the picture, and report that."""
    if curve.length > 0:
        return False
    audit.find("nothing_in_picture", about=name)
    return True


def _note_cut(curve: Curve, name: str, audit: Audit) -> float:
    """Note and return the share of a curve that lies inside the picture."""
    share = curve.length / curve.whole_length
    audit.notes.append(
        f"Only {share:.0%} of {name} lies inside the picture; the robots spread over that."
    )
    return share


def _check_along(part: Part, audit: Audit) -> None:
    _check_outside(part, audit)
    curve = reference_curve(part.group, part.site, part.radius)
    if _nowhere(curve, "that side", audit):
        return
    if curve.length < WHOLE * curve.whole_length:
        _note_cut(curve, "that side", audit)
    if part.group.edges is not None:
        spacing.on_edges(part, part.group.edges, audit)
    else:
        direction = side_direction(part.group, part.outline, part.site)
        spacing.on_side(part, curve, direction, audit)
    _check_gaps(part, curve, audit)


def _check_gaps(part: Part, curve: Curve, audit: Audit) -> None:
    """Check the distances between neighbours on a curve by whatever the contract demands."""
    group = part.group
    if group.opens:
        gaps.opening_left(part, curve, audit)
    elif group.pitch is None and group.spacing == "even" and not escape_proof(group):
        spacing.evenness(part, curve, audit)
    if group.pitch is not None:
        gaps.pitch_kept(part, curve, audit)
    if group.max_gap is not None and group.relation != "cage":
        gaps.no_wider(part, curve, audit)


def _check_shape(part: Part, audit: Audit) -> None:
    shape = part.group.shape
    if shape is None:
        _check_line(part, audit)
        return
    figure = figure_of(part.group, shape, part.site, part.radius)
    if not part.group.enters:
        _check_off_targets(part, audit)
    if shape.where == "inside":
        _check_depth(part, audit)
    elif part.group.clearance is not None:
        clearance = distances(part.outline.filled, part.points) - part.radius
        (least, greatest), name = part.clearance, part.group.targets[0]
        audit.least("min_clearance_px", clearance.min())
        audit.greatest("max_clearance_px", clearance.max())
        if drawn_by(figure).distance(part.outline.filled) > greatest + part.radius + TOLERANCE:
            robot = part.first + int(clearance.argmin())
            audit.find("too_far", clearance.min(), greatest, robot=robot, about=name)
        for i in np.flatnonzero(clearance < least - TOLERANCE):
            audit.find("too_near", clearance[i], least, robot=part.first + i, about=name)
    on_figure(part, figure, audit)
    if part.group.pitch is not None:
        gaps.pitch_nearest(part, audit)


def _check_off_targets(part: Part, audit: Audit) -> None:
    for name in part.group.targets:
        distance = distances(part.site.outlines[name].filled, part.points)
        for i in np.flatnonzero(distance <= part.radius):
            audit.find("on_target", 0.0, part.radius, robot=part.first + i, about=name)


def _check_line(part: Part, audit: Audit) -> None:
    _check_off_targets(part, audit)
    if part.group.relation == "shape" and part.group.line is None:
        audit.notes.append("A free shape: bounds, spacing and named targets were checked.")
        return
    if part.group.relation == "between":
        curve = curve_between(part.group, part.site, part.site.frame(part.radius), whole=True)
    else:
        curve = reference_curve(part.group, part.site, part.radius)
    if _nowhere(curve, "the line", audit):
        return
    if curve.length < WHOLE * curve.whole_length:
        _note_cut(curve, "the line", audit)
    reach = max(LINE_SHARE * curve.length, 2.0)
    spacing.on_curve(part, curve.geometry(), reach, "the line", audit)
    _check_gaps(part, curve, audit)


def _check_corners(part: Part, audit: Audit) -> None:
    if not part.group.on_corners:
        _check_outside(part, audit)
    spacing.corner_matching(part, audit)


def _check_inside(part: Part, audit: Audit) -> None:
    _check_depth(part, audit)
    if part.group.spacing == "even" and len(part.points) > 1:
        _check_spread(part, audit)


def _check_depth(part: Part, audit: Audit) -> None:
    """Check that every robot is inside the target, as deep as it must and no deeper than it may."""
    polygon, name = part.outline.polygon, part.group.targets[0]
    sign = np.where(shapely.intersects_xy(polygon, part.points), 1.0, -1.0)
    depth = sign * distances(polygon.boundary, part.points) - part.radius
    least, greatest = part.clearance
    audit.least("min_clearance_px", depth.min())
    for i in np.flatnonzero(depth < least - TOLERANCE):
        kind = "outside" if sign[i] < 0 else "not_inside"
        audit.find(kind, depth[i], least, robot=part.first + i, about=name)
    for i in np.flatnonzero(depth > greatest + TOLERANCE):
        audit.find("too_deep", depth[i], greatest, robot=part.first + i, about=name)


def _check_spread(part: Part, audit: Audit) -> None:
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
        audit.find("uneven", apart, least)
    if cover > most + TOLERANCE:
        audit.find("uncovered", cover, most)


def _uncovered_at_most(
    cover: float, region: Outline, ideal: FloatArray, cells: FloatArray
) -> float:
    """Return how far ground may be from the nearest robot, px, or less if `cover` meets that.

    A sample of the ground gives a lower bound, which saves measuring all of it.
    """
    most = np.inf
    for every in (SAMPLED, 1) if len(ideal) else ():
        most = COVER_SHARE * coverage_radius(region, ideal, cells[::every])
        if cover <= most:
            break
    return most


def _check_centre(part: Part, audit: Audit) -> None:
    outline = part.site.visible(part.group.targets[0])
    distance = np.linalg.norm(part.points - outline.centre, axis=1)
    most = CENTRE_SHARE * outline.size
    audit.greatest("max_from_centre_px", distance.max())
    for i in np.flatnonzero(distance > most + TOLERANCE):
        audit.find("off_centre", distance[i], most, robot=part.first + i, about="the centre")


def _check_at(part: Part, audit: Audit) -> None:
    """Check that every robot is at its own point, and off the group's targets."""
    _check_off_targets(part, audit)
    wanted = np.asarray(part.group.points, dtype=float)
    off = np.linalg.norm(part.points - wanted, axis=1)
    audit.greatest("max_from_point_px", off.max())
    for i in np.flatnonzero(off > AT_POINT + TOLERANCE):
        about = "({:.0f}, {:.0f})".format(*wanted[i])
        audit.find("off_point", off[i], AT_POINT, robot=part.first + i, about=about)


_RULES: dict[str, Callable[[Part, Audit], None]] = {
    "around": _check_around,
    "cage": _check_around,
    "along": _check_along,
    "corners": _check_corners,
    "inside": _check_inside,
    "between": _check_line,
    "shape": _check_shape,
    "centre": _check_centre,
    "at": _check_at,
}
