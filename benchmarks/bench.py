"""`make bench`: CPU time of each tool on a 2-megapixel photograph beside the bare library calls.

The bare calls are the part that no implementation of the tool could do without, made directly with
OpenCV, shapely, scipy or Pillow on the same data; the ratio shows what formup adds around them.
"""

import asyncio
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from ..evals.tasks.annotations import PHOTOS
from ..evals.tasks.suites import load_suite
from ..tools.builtin import TOOLS
from ..tools.context import Context, Services
from ..tools.geometry.outline import FloatArray, distances, outline_of
from ..tools.perception.contours import mask_of_outline
from ..tools.perception.image import load_picture, picture_from_array
from ..tools.perception.target_prompt import TargetPrompt
from .growth import Work, beside, best, growth, heading, show

SIZE = (1920, 1080)
REPEATS = 5
ROBOTS, PROBES = 24, 1000
SIDES = (0.25, 0.5, 1, 2)
"""Sides of the pictures used to measure growth, as fractions of those of SIZE."""
TEAMS = (6, 24, 96)
FINDING = "k-means, 150 thresholds at 384 px, contours"
RING = "shapely buffer, interpolate"
SPREADING = "4 x 40 cKDTree queries of 6000 cells"
MOVING = "scipy assignment, shapely intersects"
PLACING = ("sample_along_edges", "sample_inside", "sample_shape", "propose_formation", "deploy")


class Case(NamedTuple):
    """A tool with its arguments, and the bare library calls, described and as a function."""

    tool: str
    arguments: dict[str, Any]
    calls: str
    bare: Work


def rows() -> Iterator[str]:
    """Yield the table, then how the times grow with pixels and robots."""
    context = _with_plan(_with_targets(SIZE))
    yield f"{SIZE[0]} x {SIZE[1]} px, CPU milliseconds, best of {REPEATS}"
    yield heading("tool", "bare calls")
    for case in _cases(context):
        yield beside(case.tool, _timed(context, case), best(case.bare, REPEATS), case.calls)
    yield f"\n{'growth':28} fitted"
    sizes = [(round(SIZE[0] * share), round(SIZE[1] * share)) for share in SIDES]
    pixels = [width * height for width, height in sizes]
    yield from _growth("pixels", pixels, [_with_plan(_with_targets(size)) for size in sizes])
    yield from _growth("robots", TEAMS, [_with_plan(context, n) for n in TEAMS], PLACING)


def _growth(
    what: str, numbers: Sequence[int], contexts: list[Context], names: Sequence[str] | None = None
) -> Iterator[str]:
    for cases in zip(*map(_cases, contexts), strict=True):
        if names is None or cases[0].tool in names:
            found = [_timed(c, case) for c, case in zip(contexts, cases, strict=True)]
            yield growth(cases[0].tool, what, numbers, found)


def _timed(context: Context, case: Case) -> float:
    tool = next(t for t in TOOLS if t.name == case.tool.partition(" ")[0])
    searched = tool.name == "locate_object"  # the others reuse an earlier search
    return best(lambda: asyncio.run(tool.call(_anew(context, searched), case.arguments)), REPEATS)


def _anew(context: Context, searched: bool) -> Context:
    """Return the context without anything that an earlier call computed and cached.

    Args:
        searched: whether the call has to find the candidates in the picture anew.
    """
    targets = tuple(
        t.model_copy(update={"outline": outline_of(t.outline.polygon)})
        for t in context.world.targets
    )
    found = {} if searched else context.services.found
    services = Services(pictures=context.services.pictures, found=found)
    return replace(context, world=context.world.having(targets=targets), services=services)


def _with_targets(size: tuple[int, int]) -> Context:
    """Return the picture of two cars at a size (w, h), px, with the red one as t1, the other as t2.

    Both are segmented.
    """
    path = PHOTOS / "images" / "cars_two.jpg"
    task = next(t for t in load_suite("photos").tasks if t.picture == path and len(t.things) == 2)
    photo = load_picture(path)
    scale = np.array(size) / (photo.width, photo.height)
    context = Context.of(
        picture_from_array(np.asarray(cv2.resize(photo.pixels, size), dtype=np.uint8))
    )
    for name, thing in zip(("t1", "t2"), task.things, strict=True):
        box = np.asarray(thing.outline.bounds) * np.tile(scale, 2)
        context = _after(context, "segment", {"id": name, "box": box.tolist()})
    pointed = TargetPrompt(id="t3", box=context.world.target("t1").box)  # for locate_object
    return context.at(context.world.having(pointed=(pointed,)))


def _after(context: Context, name: str, arguments: dict[str, Any]) -> Context:
    """Return the context after a call of a tool."""
    tool = next(t for t in TOOLS if t.name == name)
    world = asyncio.run(tool.call(context, arguments)).world
    return context if world is None else context.at(world)


def _with_plan(context: Context, robots: int = ROBOTS) -> Context:
    """Return the context with a plan around the red car."""
    return _after(context, "propose_formation", {"contract": {"groups": [_group(robots)]}})


def _group(robots: int) -> dict[str, Any]:
    return {"relation": "around", "targets": ["t1"], "robots": robots}


def _cases(context: Context) -> list[Case]:
    size = context.picture.width, context.picture.height
    box = [round(v) for v in context.world.target("t1").box]
    plan = context.world.plan().plan
    robots = plan.formation.contract.robots
    group = _group(robots)
    probes = np.random.default_rng(0).uniform((0, 0), size, (PROBES, 2))
    cut = "bilateral, 5 x GrabCut at 160 px"
    red = {"colours": ["red"], "picks": [{"by": "largest"}]}
    between = {"kind": "between", "n": robots // 3, "targets": ["t1", "t2"]}
    one = {"target": "t1"}
    cases: list[tuple[str, dict[str, Any], str, Work]] = [
        ("look", {}, "Pillow resize, PNG", lambda: _bare_look(context)),
        ("locate_object", {}, cut, lambda: _bare_segment(context, box)),
        ("locate_object query", {"query": red}, FINDING, lambda: _bare_candidates(context)),
        ("segment", {"id": "t1", "box": box}, cut, lambda: _bare_segment(context, box)),
        ("describe_shape", one, "findContours, approxPolyDP, minAreaRect", _bare_describe(context)),
        (
            "check_point",
            one | {"points": probes.tolist()},
            "shapely contains, distance",
            _bare_check(context, probes),
        ),
        ("sample_along_edges", one | {"n": robots}, RING, _bare_ring(context)),
        ("sample_inside", one | {"n": robots}, SPREADING, _bare_inside(context)),
        ("sample_shape", between, "shapely difference, interpolate", _bare_between(context)),
        ("measure", {"a": "t1", "b": "t2"}, "shapely distance", _bare_measure(context)),
        (
            "propose_formation",
            {"contract": {"groups": [group]}},
            "shapely buffer, distance; cKDTree",
            _bare_propose(context),
        ),
        ("deploy", {"plan_id": plan.id}, MOVING, _bare_deploy(context, plan.formation.points)),
    ]
    return [Case(*case) for case in cases]


def _bare_look(context: Context) -> bytes:
    buffer = io.BytesIO()
    image = Image.fromarray(context.picture.pixels)
    image.resize((1500, 844)).save(buffer, "PNG")
    return buffer.getvalue()


def _bare_segment(context: Context, box: list[int]) -> object:
    x0, y0, x1, y1 = box
    reach_x, reach_y = (x1 - x0) // 4, (y1 - y0) // 4
    crop = context.picture.pixels[
        max(y0 - reach_y, 0) : y1 + reach_y, max(x0 - reach_x, 0) : x1 + reach_x
    ]
    scale = 160 / max(crop.shape[:2])
    small = cv2.resize(crop, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    smooth = np.asarray(cv2.bilateralFilter(small, 7, 40, 5), dtype=np.uint8)
    labels = np.empty(0)
    for _ in range(5):
        labels = np.full(smooth.shape[:2], cv2.GC_PR_BGD, np.uint8)
        labels[:3], labels[-3:], labels[:, :3], labels[:, -3:] = 0, 0, 0, 0
        labels[20:-20, 15:-15] = cv2.GC_PR_FGD
        model = np.zeros((1, 65)), np.zeros((1, 65))
        cv2.grabCut(smooth, labels, (0, 0, 1, 1), *model, 4, cv2.GC_INIT_WITH_MASK)
    return labels


def _bare_candidates(context: Context) -> int:
    """Count the contours at every threshold of three channels and of distances to nine colours."""
    small = cv2.resize(context.picture.pixels[::2, ::2], (384, 216))
    smooth = np.asarray(cv2.bilateralFilter(small, 7, 40, 5), dtype=np.float32)
    lab = np.asarray(cv2.cvtColor(smooth / 255, cv2.COLOR_RGB2LAB), dtype=np.float32)
    cues: list[NDArray[np.float32]] = [lab[..., k] for k in range(3)]
    for count in (3, 6):
        stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 12, 1.0)
        sample, none = lab.reshape(-1, 3)[::16], np.empty(0, np.int32)
        _, _, centres = cv2.kmeans(sample, count, none, stop, 1, cv2.KMEANS_PP_CENTERS)
        away = (np.linalg.norm(lab - c, axis=2) for c in np.asarray(centres, np.float32))
        cues += [np.asarray(d, dtype=np.float32) for d in away]
    found = 0
    for cue in cues:
        for level in np.quantile(cue, np.linspace(0.02, 0.98, 12)):
            above = np.asarray(cue > level, dtype=np.uint8)
            cv2.connectedComponentsWithStats(above, connectivity=4)
            contours, _ = cv2.findContours(above, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
            found += len(contours)
    return found


def _bare_describe(context: Context) -> Work:
    picture = context.picture
    mask = mask_of_outline(context.world.target("t1").outline, picture.width, picture.height)
    raster = mask.astype(np.uint8)

    def work() -> object:
        contours, _ = cv2.findContours(raster, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
        return [(cv2.approxPolyDP(c, 4, True), cv2.minAreaRect(c)) for c in contours]

    return work


def _bare_check(context: Context, probes: FloatArray) -> Work:
    polygon = context.world.target("t1").outline.polygon
    edge = polygon.boundary
    return lambda: (shapely.contains_xy(polygon, probes), distances(edge, probes))


def _bare_ring(context: Context) -> Callable[[], FloatArray]:
    filled = context.world.target("t1").outline.filled

    def work() -> FloatArray:
        loop = shapely.LineString(shapely.get_coordinates(filled.buffer(80)))
        steps = np.arange(ROBOTS, dtype=float) * loop.length / ROBOTS
        return shapely.get_coordinates(shapely.line_interpolate_point(loop, steps))

    return work


def _bare_inside(context: Context) -> Work:
    x0, y0, x1, y1 = context.world.target("t1").outline.bounds
    random = np.random.default_rng(0)
    cells = random.uniform((x0, y0), (x1, y1), (6000, 2))
    robots = random.uniform((x0, y0), (x1, y1), (ROBOTS, 2))
    return lambda: [cKDTree(robots).query(cells) for _ in range(4 * 40)]


def _bare_between(context: Context) -> Work:
    a, b = (context.world.target(t).outline.filled for t in ("t1", "t2"))

    def work() -> object:
        line = shapely.LineString([a.centroid, b.centroid]).difference(shapely.union(a, b))
        shares = np.arange(ROBOTS // 3) / 7
        return [line.interpolate(float(share), normalized=True) for share in shares]

    return work


def _bare_measure(context: Context) -> Work:
    a, b = (context.world.target(t).outline.polygon for t in ("t1", "t2"))
    return lambda: shapely.distance(a, b)


def _bare_propose(context: Context) -> Work:
    filled = context.world.target("t1").outline.filled
    ring = _bare_ring(context)

    def work() -> object:
        points = ring()
        return distances(filled, points), cKDTree(points).query(points, k=2)

    return work


def _bare_deploy(context: Context, goals: FloatArray) -> Work:
    filled = context.world.target("t1").outline.filled
    starts = np.random.default_rng(0).uniform((0, 0), SIZE, goals.shape)

    def work() -> object:
        pairs = linear_sum_assignment(cdist(starts, goals, "sqeuclidean"))
        lines = shapely.linestrings(np.stack([starts[pairs[0]], goals[pairs[1]]], axis=1))
        return shapely.intersects(lines, filled.buffer(20))

    return work


if __name__ == "__main__":
    show(rows())
