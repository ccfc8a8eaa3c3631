"""How many tokens the three descriptors of a shape cost a model, on the same shapes.

The paper compares edges, edges with vertices, and a binary matrix (its Table III); here the things
are those of the shipped photographs, each by its true outline.
"""

import asyncio
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median
from typing import get_args

from ...tools.builtin import TOOLS
from ...tools.context import Context, Descriptor
from ...tools.perception.image import load_picture
from ...tools.world import Target, World
from ..tasks.photographs import Task
from .tokens import text_tokens


@dataclass(frozen=True)
class DescriptorCost:
    """Tokens of describe_shape's reply under one descriptor.

    Attributes:
        overhead: tokens over those of edges less one, over all shapes, as the paper has it.
    """

    descriptor: str
    median: float
    most: int
    overhead: float


def descriptor_costs(tasks: Iterable[Task]) -> list[DescriptorCost]:
    """The cost of each descriptor over the things that tasks are about, each thing once."""
    things = {(t.image, t.target.id): t for t in tasks}
    counts = {d: [_tokens(t, d) for t in things.values()] for d in get_args(Descriptor)}
    least = sum(counts["edges"])
    return [DescriptorCost(d, median(n), max(n), sum(n) / least - 1) for d, n in counts.items()]


def _tokens(task: Task, descriptor: str) -> int:
    outline = task.target.outline
    target = Target(
        id="t1",
        label=task.target.name,
        box=outline.bounds,
        confidence=1.0,
        outline=outline,
        prompt="truth",
    )
    picture = load_picture(task.image)
    context = Context.of(picture, world=World.of(picture, targets=(target,)))
    describe = next(tool for tool in TOOLS if tool.name == "describe_shape")
    made = asyncio.run(describe.call(context, {"target": "t1", "descriptor": descriptor}))
    return text_tokens(made.text)
