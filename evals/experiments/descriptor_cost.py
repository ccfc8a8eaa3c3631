"""The cost of the three descriptors of a shape in a model's tokens, on the same shapes.

The paper compares edges, edges with vertices, and a binary matrix (its Table III); here the things
are those that a suite's tasks are about, each by its true outline.
"""

import asyncio
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import get_args

from ...tools.builtin import TOOLS
from ...tools.context import Context, Descriptor
from ...tools.perception.image import load_picture
from ...tools.world import Target, World
from ..tasks.task import Task, Thing
from .tokens import text_tokens


@dataclass(frozen=True)
class DescriptorCost:
    """Tokens of describe_shape's reply under one descriptor.

    Attributes:
        overhead: tokens over those of edges, minus 1, over all shapes, as in the paper.
    """

    descriptor: str
    median: float
    most: int
    overhead: float


def descriptor_costs(tasks: Iterable[Task], pictures: Mapping[str, Path]) -> list[DescriptorCost]:
    """Return the cost of each descriptor over the things that tasks are about, each thing once.

    Args:
        tasks: of a suite.
        pictures: file of each, by the task's id.
    """
    things = {(pictures[task.id], t.id): t for task in tasks for t in task.things}
    counts = {
        d: [_described_tokens(path, thing, d) for (path, _), thing in things.items()]
        for d in get_args(Descriptor)
    }
    least = sum(counts["edges"])
    return [DescriptorCost(d, median(n), max(n), sum(n) / least - 1) for d, n in counts.items()]


def _described_tokens(picture: Path, thing: Thing, descriptor: str) -> int:
    outline = thing.outline
    target = Target(
        id="t1",
        label=thing.name,
        box=outline.bounds,
        confidence=1.0,
        outline=outline,
        prompt="truth",
    )
    shown = load_picture(picture)
    context = Context.of(shown, world=World.of(shown, targets=(target,)))
    describe = next(tool for tool in TOOLS if tool.name == "describe_shape")
    made = asyncio.run(describe.call(context, {"target": "t1", "descriptor": descriptor}))
    return text_tokens(made.text)
