"""Draws how a target escapes from a cage: the path of its centre, and outlines along it.

The path is found and checked elsewhere.
"""

import numpy as np
import shapely
from shapely.affinity import rotate, translate
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from ..formation.checking.verdict import Escape
from ..formation.placement.place import Site
from ..geometry.outline import FloatArray
from .canvas import MARKS, Canvas
from .marks import rings

WAY = MARKS[2]
GHOSTS = 3
"""Number of outlines drawn along the way, besides the target itself."""
STEPS = 25
"""Number of straight pieces in which each move between two poses is drawn."""


def draw_escape(canvas: Canvas, escape: Escape, site: Site) -> None:
    """Draw faint outlines of the target on its way out, and its centre's path with an arrowhead.

    Only the part up to the path's last pose inside the picture is drawn.
    """
    outline = site.outlines[escape.target]
    poses = _densified(np.asarray(escape.poses, dtype=float))
    centre = shapely.Point(outline.centre)
    way = np.array([shapely.get_coordinates(_in_pose(centre, p, poses[0]))[0] for p in poses])
    picture = Polygon.from_bounds(-0.5, -0.5, site.width - 0.5, site.height - 0.5)
    seen = np.flatnonzero(shapely.intersects_xy(picture, way))
    last = int(seen[-1]) if len(seen) else 0
    simple = outline.filled.simplify(0.3 / canvas.page_length(1.0))
    for share in np.arange(1, GHOSTS + 1) / GHOSTS:
        ghost = _in_pose(simple, poses[_index_at_share(way[: last + 1], float(share))], poses[0])
        shown = ghost.intersection(picture)
        canvas.tint(shown, WAY, 0.1)
        canvas.strokes(rings(shown), WAY, 1.6, 0.4 + 0.6 * float(share))
    if last == 0:
        return
    shown = way[: last + 1]
    canvas.dashes([shown], WAY, 2.2)
    canvas.disc(shown[0], 3.0, WAY, 1.0)
    canvas.cased(_arrowhead(shown, 9 / canvas.page_length(1.0)), WAY, 2.2)


def _densified(poses: FloatArray) -> FloatArray:
    """Interpolate linearly between successive poses (n, 3), to (k, 3)."""
    whole = np.arange(len(poses), dtype=float)
    between: FloatArray = np.linspace(0, len(poses) - 1, (len(poses) - 1) * STEPS + 1)
    columns = [np.asarray(np.interp(between, whole, poses[:, k]), dtype=float) for k in range(3)]
    return np.stack(columns, axis=1)


def _in_pose(thing: BaseGeometry, pose: FloatArray, start: FloatArray) -> BaseGeometry:
    x, y, turn = (float(v) for v in pose)
    origin = (float(start[0]), float(start[1]))
    turned = rotate(thing, turn, origin=origin, use_radians=True)
    return translate(turned, x - origin[0], y - origin[1])


def _index_at_share(way: FloatArray, share: float) -> int:
    """Return the index of the first point at or past a share of the line's length."""
    steps: FloatArray = np.linalg.norm(np.diff(way, axis=0, prepend=way[:1]), axis=1)
    gone = np.cumsum(steps)
    return int(np.searchsorted(gone, share * float(gone[-1]) * (1 - 1e-9)))


def _arrowhead(way: FloatArray, size: float) -> list[FloatArray]:
    tip = way[-1]
    back = way[max(len(way) - 2, 0)] - tip
    back *= size / max(float(np.linalg.norm(back)), 1e-9)
    side = np.array([-back[1], back[0]]) * 0.55
    head: FloatArray = np.stack([tip + back + side, tip, tip + back - side])
    return [head]
