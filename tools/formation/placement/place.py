"""Computes positions that satisfy a contract from it and the site alone.

Each relation has one reference (a curve, corners, a region, a point) that the checker also
measures against. Frame: image pixels, x right, y down.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry import LineString, MultiLineString, Polygon

from ...errors import ToolError
from ...geometry.curves import Curve, Frame, edge_curve, segment, side
from ...geometry.interior import inside
from ...geometry.outline import FloatArray, Outline, distances
from ...geometry.sampling import (
    along_curve,
    around_point,
    at_corners,
    corner_points,
    min_spacing,
    spread_subset,
)
from ..contract import CENTRE_SHARE, DIRECTIONS, OUTSIDE, Contract, Group, nominal
from ..site import CapacityError, Site, most_that_fit
from .caging import caged_places, escape_proof
from .figure import figure_of, place_figure
from .group_conflicts import (
    CrowdedError,
    Stand,
    clear_of_earlier,
    conflict,
    region_left_by,
    shifted_places,
)
from .pitch import pitch_offset, pitch_places
from .ring_parts import ring_of

TOUCH = 1.0
"""Robots between two targets keep at least this far off them, px."""
MOST_AVOIDED = 20
"""Most extra places at a centre that are considered if other robots stand on some."""
REFLEX = 1.5
"""Greatest distance of a robot from its corner, as a multiple of its greatest distance from the
outline; needed are 1 at a convex corner, the square root of 2 in a right-angled reflex one."""
AT_CORNER = 0.5
"""A robot whose centre is within this distance of a corner, px, is on it."""
ROUNDING = 2e-6
"""Tolerance on a clearance, px: places off corners are found to within half of this."""
LONG = 1.2
"""Ratio of length to width from which an object has two long sides."""
DRAWN_BY_NUMBER = frozenset({"between", "centre"})
"""Relations whose places depend on the number of robots, so some would not be used by fewer."""


Sound = Callable[[Group, FloatArray], bool]
"""Returns whether a group alone is certified at the given places."""


def place(contract: Contract, site: Site, sound: Sound = lambda group, points: True) -> FloatArray:
    """Place all robots, groups in order, (N, 2), image pixels.

    Args:
        contract: with its defaults filled in.
        site: the outlines and the picture.
        sound: accepts places of a group that cannot be placed as it would be alone.

    Raises:
        CapacityError: a group has more robots than fit; its `fits` says how many do.
        CageError: its robots cannot be placed escape-proof; `needed` says how many would do.
        CrowdedError: a group would stand in the way of an earlier one.
        ToolError: the contract leaves positions to the caller (a free shape).
    """
    stands: list[Stand] = []
    for group in contract.groups:
        stands.append(stand_of(group, contract, stands, site, sound))
    return np.concatenate([stand.points for stand in stands])


def stand_of(
    group: Group,
    contract: Contract,
    earlier: list[Stand],
    site: Site,
    sound: Sound = lambda group, points: True,
) -> Stand:
    """Place a group of a contract beside the groups that are already placed.

    Raises:
        CapacityError, CageError, CrowdedError, ToolError: as in `place`.
    """
    stand = Stand(group, _place_group(group, site, contract.robot_radius))
    clash = conflict(stand, earlier)
    solid = _foreign(contract, group, site)
    if clash is not None or _stands_on(solid, stand.points, contract.robot_radius):
        return _alternative_stand(contract, stand, earlier, site, clash, sound)
    return stand


def _foreign(contract: Contract, group: Group, site: Site) -> list[Polygon]:
    """Return what a group's robots may not stand on, other than its own targets."""
    return [site.solid(t, contract) for t in contract.solid_targets if t not in group.targets]


def _stands_on(solid: list[Polygon], points: FloatArray, radius: float) -> bool:
    return any(bool((distances(thing, points) <= radius).any()) for thing in solid if len(points))


def reference_curve(group: Group, site: Site, radius: float, offset: float | None = None) -> Curve:
    """Return the curve that a ring, side, line, shape or between group stands on.

    Args:
        group: with its defaults filled in.
        site: the outlines and the picture.
        radius: radius of a robot, px.
        offset: distance of robots' centres from the outline, px; None for the nominal one.
    """
    frame = site.frame(radius)
    if group.shape is not None:
        lines = figure_of(group, group.shape, site, radius).lines
        return Curve(lines, False, MultiLineString([LineString(x) for x in lines]).length)
    if group.relation == "shape":
        ends = np.asarray(group.line or (0, 0, 0, 0), dtype=float).reshape(2, 2)
        return segment(ends[0], ends[1], frame)
    if group.relation == "between":
        return curve_between(group, site, frame)
    outline = site.outlines[group.targets[0]]
    if offset is None and group.solves_clearance:
        offset = pitch_offset(group, site, radius)
    offset = nominal(group.offsets()) + radius if offset is None else offset
    if group.relation != "along":
        return ring_of(group, site, radius, offset)
    if group.edges is not None:
        last = len(outline.edges) - 1
        if max(group.edges) > last:
            name = group.targets[0]
            raise ToolError(f"There is no edge {max(group.edges)}: {name} has edges 0 to {last}.")
        return edge_curve(outline, group.edges, offset, frame)
    return side(outline, side_direction(group, outline, site), offset, frame)


def side_direction(group: Group, outline: Outline, site: Site) -> tuple[float, float]:
    """Return the outward vector of a group's side; for long or short, the one with more room.

    Raises:
        ToolError: the other side is asked for of an object about as wide as it is long.
    """
    if group.facing is not None:
        return _facing(outline, site.outlines[group.facing])
    name = group.side or "bottom"
    if name in DIRECTIONS:
        return DIRECTIONS[name]
    (unit, length, width), other = outline.long_axis, name.startswith("other ")
    if other and length < LONG * width:
        raise ToolError(
            f"{group.targets[0]} is about as wide as it is long and has no two long sides: name "
            "its sides, left and right or top and bottom."
        )
    normal = np.array([-unit[1], unit[0]]) if name.endswith("long") else unit
    reach = (width if name.endswith("long") else length) / 2
    middle = shapely.get_coordinates(outline.polygon.centroid)[0]

    def room(way: FloatArray) -> float:
        x, y = middle + way * reach * 1.2
        return min(x, y, site.width - 1 - x, site.height - 1 - y)

    best = max((normal, -normal), key=room) * (-1 if other else 1)
    return float(best[0]), float(best[1])


def _facing(outline: Outline, other: Outline) -> tuple[float, float]:
    """Return the outward vector of the side that faces another target.

    It points to the nearest place of the other target. For a polygonal outline it is the normal
    closest to that direction, so that a line does not run around a corner.
    """
    link = shapely.get_coordinates(shapely.shortest_line(outline.filled, other.filled))
    towards = link[-1] - link[0]
    if np.linalg.norm(towards) < TOUCH:
        centres = [shapely.get_coordinates(o.filled.centroid)[0] for o in (outline, other)]
        towards = centres[1] - centres[0]
    if outline.kind == "polygonal":
        along = np.diff(outline.bulk_rectangle, axis=0)[:2]
        unit = along / np.linalg.norm(along, axis=1, keepdims=True)
        normals = np.concatenate([unit, -unit])
        towards = normals[int(np.argmax(normals @ towards))]
    return float(towards[0]), float(towards[1])


def corner_reach(group: Group, outline: Outline, radius: float) -> FloatArray:
    """Return how far from each corner a robot may stand, (k,), px.

    A rounded outline falls short of its corners; a reflex corner is approached along its bisector.
    """
    if group.on_corners:
        return np.full(len(corner_points(outline, group.robots)), AT_CORNER)
    short = distances(outline.filled, corner_points(outline, group.robots))
    return REFLEX * group.offsets(radius)[1] + short


def _alternative_stand(
    contract: Contract,
    stand: Stand,
    earlier: list[Stand],
    site: Site,
    clash: tuple[int, float, float] | None,
    sound: Sound,
) -> Stand:
    """Find other places for a group, off foreign targets and clear of robots placed before.

    If there are none and the group only stands on a foreign target, it stays as it is, which the
    checker reports.

    Raises:
        CrowdedError: the group clashes with an earlier one and no other places were found.
    """
    group, radius = stand.group, contract.robot_radius
    solid = _foreign(contract, group, site)
    for points in _alternative_places(group, earlier, site, radius):
        other = Stand(group, points)
        free = len(points) == group.robots and conflict(other, earlier) is None
        if free and not _stands_on(solid, points, radius) and sound(group, points):
            return other
    if clash is None:
        return stand
    index, apart, least = clash
    raise CrowdedError(index, len(earlier), site.length(apart), site.length(least))


def _alternative_places(
    group: Group, earlier: list[Stand], site: Site, radius: float
) -> Iterator[FloatArray]:
    """Yield alternative places for a group that are equally good in themselves, if any."""
    n, spacing = group.robots, group.min_spacing or 0.0
    if group.shape is not None or escape_proof(group) or not (group.targets or group.line):
        return
    if group.relation in ("corners", "centre"):
        yield _place_at_target(group, site, radius, earlier)[0]
    elif group.relation == "inside":
        least, greatest = group.offsets(radius)
        left = region_left_by(site.visible(group.targets[0]), group, earlier, least)
        if left is not None:
            yield inside(left, n, least, greatest, spacing)
    else:
        for offset in _offsets(group, radius):
            for points in shifted_places(reference_curve(group, site, radius, offset), n):
                if min_spacing(points) >= spacing * (1 - 1e-6):
                    yield points


def _offsets(group: Group, radius: float) -> tuple[float | None, ...]:
    """Return offsets that a curve may have from the outline, px; None, the nominal one, first."""
    if group.clearance is None or group.relation not in OUTSIDE or group.radius is not None:
        return (None,)
    least, greatest = group.clearance
    aim = nominal(group.clearance)
    ends = [aim + share * (end - aim) for share in (0.45, 0.9) for end in (least, greatest)]
    return (None, *(radius + max(end, 0.1) for end in ends if end <= 4 * aim))


def _place_group(group: Group, site: Site, radius: float) -> FloatArray:
    if group.shape is not None:
        return place_figure(group, group.shape, site, radius)
    if group.points is not None:
        return np.asarray(group.points, dtype=float)
    if group.relation == "shape" and group.line is None:
        raise ToolError("A free shape has no places of its own: give the positions.")
    points, why = _as_many_as_fit(group, site, radius)
    fits = len(points)
    if fits == group.robots:
        return points

    def alone(n: int) -> bool:
        fewer = group.model_copy(update={"robots": n})
        return len(_as_many_as_fit(fewer, site, radius)[0]) == n

    if group.relation in DRAWN_BY_NUMBER:
        fits = most_that_fit(alone, fits, group.robots)
    raise CapacityError(group, fits, why)


def _as_many_as_fit(group: Group, site: Site, radius: float) -> tuple[FloatArray, str]:
    """Return places (k, 2) for all robots, or for those that fit, and why no more do."""
    if group.relation in ("corners", "inside", "centre"):
        return _place_at_target(group, site, radius)
    curve = reference_curve(group, site, radius)
    if escape_proof(group):
        return caged_places(group, site, radius, curve), ""
    spacing = group.pitch or group.min_spacing or 0.0
    left, apart = site.length(curve.length, ".0f"), site.length(spacing, "g")
    why = f"the {left} that are left to stand on allow no more at {apart}"
    if group.relation == "cage" and not curve.closed:
        why += ", and the picture's border cuts the ring open"
    if group.pitch is not None:
        return pitch_places(group, curve, site), why
    return _fit(curve, group.robots, spacing), why


def _place_at_target(
    group: Group, site: Site, radius: float, earlier: Sequence[Stand] = ()
) -> tuple[FloatArray, str]:
    outline = site.visible(group.targets[0])
    n, spacing = group.robots, group.min_spacing or 0.0
    if group.relation == "corners":
        count = len(corner_points(outline, n))
        why = f"{group.targets[0]} has {count} corners, less those without room in the picture"
        return _corner_places(group, site, radius, earlier), why
    if group.relation == "inside":
        points = inside(outline, n, *group.offsets(radius), spacing)
        edge = site.length(group.offsets()[0])
        return points, f"spaced {site.length(spacing, 'g')} and {edge} from the edge"
    pitch = max(spacing * 1.05, min(0.1 * outline.size, CENTRE_SHARE * outline.size / n**0.5))
    most = CENTRE_SHARE * outline.size

    def near(points: FloatArray) -> FloatArray:
        return points[np.linalg.norm(points - outline.centre, axis=1) <= most]

    crowd = sum(len(other.points) for other in earlier)
    points = near(around_point(outline.centre, n + min(crowd, n + MOST_AVOIDED), pitch))
    points = near(_drawn_in(points, site.frame(radius).box))
    points = points[clear_of_earlier(points, group, earlier)][:n]
    return points, f"within {site.length(most, '.0f')} of the centre"


def _drawn_in(points: FloatArray, box: Polygon) -> FloatArray:
    """Move all points together into a box as far as possible; drop those still outside."""
    if box.is_empty or not len(points):
        return points[:0]
    low, high = np.reshape(box.bounds, (2, 2))
    short, over = low - points.min(axis=0), points.max(axis=0) - high
    moved = points + np.clip(short, 0, None) - np.clip(over, 0, None)
    return moved[((moved >= low) & (moved <= high)).all(axis=1)]


def _corner_places(
    group: Group, site: Site, radius: float, earlier: Sequence[Stand] = ()
) -> FloatArray:
    """Return places at the corners, moved in from the picture's border, if they have room."""
    outline, box = site.outlines[group.targets[0]], site.frame(radius).box
    corners = points = corner_points(outline, group.robots)
    if not group.on_corners:
        points = at_corners(outline, group.robots, nominal(group.offsets()) + radius)
    if box.is_empty:
        return points[:0]
    x0, y0, x1, y1 = box.bounds
    points = np.clip(points, (x0, y0), (x1, y1))
    near = np.linalg.norm(points - corners, axis=1) <= corner_reach(group, outline, radius)
    least = 0.0 if group.on_corners else group.offsets(radius)[0] - ROUNDING
    free = points[near & (distances(outline.filled, points) >= least)]
    free = free[clear_of_earlier(free, group, earlier)]
    if len(free) > group.robots:
        free = free[spread_subset(free, group.robots)]
    taken: list[FloatArray] = []
    for point in free:
        apart = [float(np.linalg.norm(point - other)) for other in taken]
        if not apart or min(apart) >= (group.min_spacing or 0.0):
            taken.append(point)
    return np.asarray(taken).reshape(-1, 2)


def _fit(curve: Curve, n: int, spacing: float) -> FloatArray:
    """Return n places evenly along the curve, or as many as keep the spacing, (k, 2)."""
    points = along_curve(curve, n)
    count = min(n, int(curve.length / spacing) + 1) if spacing > 0 else n
    while len(points) > 1 and min_spacing(points) < spacing * (1 - 1e-6):
        points = along_curve(curve, max(count, 1))
        count = min(count - 1, int(count * 0.99))
    return points


def curve_between(group: Group, site: Site, frame: Frame, *, whole: bool = False) -> Curve:
    """Return the line between two targets that joins their centroids, or a divider across it.

    A joining line is inset by a gap at either target, unless the `whole` line is asked for.

    Raises:
        ToolError: the targets touch or overlap.
    """
    first, second = (site.outlines[t] for t in group.targets)
    ends = [shapely.get_coordinates(o.filled.centroid)[0] for o in (first, second)]
    solid = shapely.union(first.filled, second.filled)
    free = LineString(ends).difference(solid)
    pieces = [g for g in shapely.get_parts(free) if isinstance(g, LineString) and g.length]
    if not pieces:
        raise ToolError("The two targets touch or overlap: nothing lies between them.")
    a, b = shapely.get_coordinates(max(pieces, key=lambda g: g.length))
    if group.layout == "line":
        inset = (b - a) / (group.robots + 1) * (group.robots > 1 and not whole)
        return segment(a + inset, b - inset, frame, solid.buffer(frame.margin + TOUCH))
    across = np.array([-(b - a)[1], (b - a)[0]]) / np.linalg.norm(b - a)
    middle = (a + b) / 2
    spans = [(shapely.get_coordinates(o.filled) - middle) @ across for o in (first, second)]
    low, high = max(s.min() for s in spans), min(s.max() for s in spans)
    if high - low < 0.3 * min(np.ptp(s) for s in spans):
        low, high = min(s.min() for s in spans), max(s.max() for s in spans)
    start, end = sorted((middle + low * across, middle + high * across), key=lambda p: (p[1], p[0]))
    return segment(start, end, frame, solid.buffer(frame.margin + TOUCH))
