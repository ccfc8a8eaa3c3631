"""Runs the agent over photographs as a person would point: the way of pointing is the variable.

truth: the drawn outline is the mask. box: the target's box, each side moved by up to 8 % of the
box. outline: at most 12 vertices, each coordinate moved by up to 4 % of the size (square root of
the area). point: one point well inside. words: nothing is pointed at.
"""

import json
import zlib
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import permutations
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from ...agent.agent import Agent, Run
from ...tools.context import Settings
from ...tools.errors import InputError
from ...tools.geometry.outline import FloatArray
from ...tools.perception.image import Picture, load_picture
from ...tools.perception.target_prompt import TargetPrompt
from ...tools.world import Target
from ..grading.photo_rules import grade
from ..tasks.photographs import Task, Thing
from .tokens import spent

Mode = Literal["truth", "outline", "box", "point", "words"]
JITTERED = ("outline", "box", "point")
ORDER = (
    *("general", "infill", "caging"),
    *("single", "multi", "hidden"),
    *("known words", "fresh words"),
)
SAME = 0.5
BOX_JITTER, OUTLINE_JITTER, OUTLINE_VERTICES = 0.08, 0.04, 12


@dataclass(frozen=True)
class Row:
    """One task under one jitter: what was asked, what came of it, and how it was graded.

    `right` says whether the thing robots were placed about is the one meant: outlines that
    overlap by more than half (intersection over union); None where nothing was placed or measured.
    """

    task: str
    mode: Mode
    seed: int
    category: str
    setup: str
    referring: str
    wording: str
    status: str
    placed: bool
    right: bool | None
    success: bool
    strict: bool
    certified: bool
    iou: float | None
    confidence: float | None
    failures: list[str]
    message: str
    requests: int
    input_tokens: int
    cached_tokens: int
    output_tokens: int


def mode_named(text: str) -> Mode:
    """A mode by name.

    Raises:
        InputError: there is none; the text lists those there are.
    """
    for mode in get_args(Mode):
        if text == mode:
            return mode
    raise InputError(f"Unknown mode {text!r}. There are: {', '.join(get_args(Mode))}.")


def one_target(tasks: Iterable[Task]) -> list[Task]:
    """The tasks about one thing: those a single pointing can settle."""
    return [task for task in tasks if task.other is None]


def evaluate(
    tasks: Iterable[Task],
    mode: Mode,
    seeds: int,
    done: Callable[[Row], None] = lambda row: None,
    *,
    agent: Callable[[Task], Agent] = lambda task: Agent(),
    record: Path | None = None,
) -> list[Row]:
    """Run every task under every seed.

    Args:
        tasks: on photographs.
        mode: how things are pointed at.
        seeds: jitters of each, where the mode has any.
        done: is told of each row as it comes.
        agent: who carries a task out.
        record: a folder for the traces, named by their tasks.
    """
    rows: list[Row] = []
    for task in tasks:
        for seed in range(seeds if mode in JITTERED else 1):
            name = f"{task.id}-{seed}.jsonl" if mode in JITTERED else f"{task.id}.jsonl"
            rows.append(_row(task, mode, seed, agent(task), record and record / name))
            done(rows[-1])
    return rows


def summary(rows: list[Row]) -> dict[str, dict[str, float | None]]:
    """Per category, setup and wording and in total: what `_means` tells of the rows."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        for name in filter(None, (row.category, row.setup, row.wording and f"{row.wording} words")):
            groups.setdefault(name, []).append(row)
    ordered = [name for name in ORDER if name in groups]
    return {name: _means(groups[name]) for name in ordered} | {"total": _means(rows)}


def as_json(row: Row) -> dict[str, object]:
    """A row as JSON data."""
    return asdict(row)


def _means(rows: list[Row]) -> dict[str, float | None]:
    """Runs; shares placed, successful and strictly so; of those placed, about the right thing
    and successful; mean IoU of what was segmented."""
    found = [row.iou for row in rows if row.iou is not None]
    placed = [row for row in rows if row.placed]
    known = [row for row in placed if row.right is not None]
    return {
        "runs": len(rows),
        "placed": len(placed) / len(rows),
        "success": float(np.mean([row.success for row in rows])),
        "strict": float(np.mean([row.strict for row in rows])),
        "right_of_placed": float(np.mean([bool(r.right) for r in known])) if known else None,
        "success_of_placed": float(np.mean([r.success for r in placed])) if placed else None,
        "iou": float(np.mean(found)) if found else None,
    }


def _row(task: Task, mode: Mode, seed: int, agent: Agent, trace: Path | None) -> Row:
    run = _run(task, mode, seed, agent, trace)
    report = run.report
    cost = spent(run.outcome.messages, agent.system, agent.offered)
    placed = report.arrival.observed if report.arrival and report.arrival.arrived else None
    if not agent.tools:
        placed = written_positions(report.message)
    graded = grade(task, placed)
    targets = run.world.targets
    target = targets[0] if targets else None
    return Row(
        task=task.id,
        mode=mode,
        seed=seed,
        category=task.category,
        setup=task.setup,
        referring=task.referring,
        wording=task.wording,
        status="answered" if not agent.tools and placed is not None else report.status,
        placed=placed is not None,
        right=None
        if placed is None or not targets
        else _right([t.outline.polygon for t in targets], task),
        success=graded.success,
        strict=graded.strict,
        certified=report.verdict is not None and report.verdict.certified,
        iou=max((round(_iou(t.outline.polygon, task.target), 4) for t in targets), default=None),
        confidence=None if target is None else target.confidence,
        failures=graded.failures + graded.strict_failures,
        message=report.message,
        requests=cost.requests,
        input_tokens=cost.input,
        cached_tokens=cost.cached,
        output_tokens=cost.output,
    )


def written_positions(text: str) -> tuple[tuple[float, float], ...] | None:
    """The positions that a model alone, without tools, has written as JSON; None if it has not."""
    whole = text[text.find("{") : text.rfind("}") + 1]
    try:
        pairs = np.asarray(json.loads(whole)["positions"], dtype=float)
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.isfinite(pairs).all():
        return None
    return tuple((float(x), float(y)) for x, y in pairs)


def _run(task: Task, mode: Mode, seed: int, agent: Agent, trace: Path | None) -> Run:
    picture = _picture(task.image)
    settings = Settings(robots=task.robots, metres_per_pixel=task.metres_per_pixel)
    if mode == "truth":
        things = [task.target, *filter(None, [task.other])]
        targets = tuple(
            Target(
                id=f"t{i}",
                label=thing.name,
                box=thing.outline.bounds,
                confidence=1.0,
                outline=thing.outline,
                prompt="truth",
            )
            for i, thing in enumerate(things, start=1)
        )
        return agent.run(picture, task.instruction, targets=targets, settings=settings, trace=trace)
    pointed = () if mode == "words" else (_prompt(task, mode, seed),)
    return agent.run(picture, task.instruction, pointed=pointed, settings=settings, trace=trace)


def _prompt(task: Task, mode: Mode, seed: int) -> TargetPrompt:
    random = np.random.default_rng([seed, zlib.crc32(task.id.encode())])
    far = np.array([task.size[0] - 1, task.size[1] - 1], dtype=float)
    if mode == "box":
        box = np.asarray(task.target.outline.bounds).reshape(2, 2)
        moved = box + random.uniform(-BOX_JITTER, BOX_JITTER, (2, 2)) * (box[1] - box[0])
        x0, y0, x1, y1 = np.clip(moved, 0, far).ravel()
        return TargetPrompt(box=(float(x0), float(y0), float(x1), float(y1)))
    if mode == "point":
        return TargetPrompt(points=(_inner_point(task, random),))
    vertices = _few_vertices(task)
    while True:  # a jitter that crosses itself is no outline a person would draw
        amount = OUTLINE_JITTER * task.target.outline.size
        moved = np.clip(vertices + random.uniform(-amount, amount, vertices.shape), 0, far)
        if Polygon(moved).is_valid:
            return TargetPrompt(outline=tuple((float(x), float(y)) for x, y in moved))


def _inner_point(task: Task, random: np.random.Generator) -> tuple[float, float]:
    """A random point of the target, off its edge by an eighth of its least width if it can be."""
    outline = task.target.outline
    inner = outline.polygon.buffer(-outline.min_width / 8)
    region = outline.polygon if inner.is_empty else inner
    x0, y0, x1, y1 = region.bounds
    while True:
        x, y = (float(v) for v in random.uniform((x0, y0), (x1, y1)))
        if shapely.contains_xy(region, x, y):
            return x, y


def _few_vertices(task: Task) -> FloatArray:
    """The true outline simplified to at most 12 vertices, (k, 2)."""
    ring = LineString([*task.target.polygon, task.target.polygon[0]])
    tolerance = 0.5
    while True:
        points = shapely.get_coordinates(ring.simplify(tolerance))[:-1]
        if len(points) <= OUTLINE_VERTICES:
            return points
        tolerance *= 1.15


def _iou(polygon: Polygon, thing: Thing) -> float:
    truth = shapely.make_valid(Polygon(thing.polygon, thing.holes))
    return float(polygon.intersection(truth).area / polygon.union(truth).area)


def _right(found: list[Polygon], task: Task) -> bool:
    """Whether the things found are those meant, in either order where there are two."""
    meant = [task.target, *filter(None, [task.other])]
    return any(
        all(_iou(polygon, thing) > SAME for polygon, thing in zip(order, meant, strict=True))
        for order in permutations(found)
        if len(order) == len(meant)
    )


@lru_cache(maxsize=4)
def _picture(path: Path) -> Picture:
    return load_picture(path)
