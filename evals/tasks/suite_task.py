"""A task of a suite and a suite of tasks, as values; and the hash by which results name a suite."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from PIL import Image

from ...agent.report import Status
from ..experiments.trials import canonical
from ..grading.graded import VERSION
from ..scenes.build import tell
from ..scenes.paint import draw
from .photographs import Task, Thing
from .recipes.inscribed import inscribe

Split = Literal["train", "dev", "test"]
SPLITS: tuple[Split, ...] = get_args(Split)


@dataclass(frozen=True)
class Drawing:
    """A picture that is drawn: the scene of a seed, perhaps with words in it."""

    seed: int
    inscription: str = ""

    @property
    def name(self) -> str:
        """Of its file."""
        return f"scene_{self.seed:06d}{'_inscribed' if self.inscription else ''}.png"

    def image(self) -> Image.Image:
        """The picture; always the same pixels."""
        story = tell(self.seed)
        drawn = draw(story.scene)
        return inscribe(drawn, story, self.inscription) if self.inscription else drawn


@dataclass(frozen=True)
class SuiteTask:
    """One instruction on one picture, and what is right.

    Attributes:
        id: unique in its suite.
        robots: as the person gives them; None leaves it to the words.
        family: of the picture; splits are by family, so that no scene is in two of them.
        style: how it is worded, or what is wrong with it.
        goals: all of them are to be reached; none where nothing is to be placed.
        expects: statuses that are right.
        picture: a file, or one that is drawn.
        must_pass: it always succeeds; the gate holds new versions to it.
        metres_per_pixel: of the picture, told to who carries it out; None where it has no scale.
    """

    id: str
    instruction: str
    robots: int | None
    category: str
    setup: str
    family: str
    split: Split
    style: str
    goals: tuple[Task, ...]
    expects: tuple[Status, ...]
    picture: Path | Drawing
    must_pass: bool = False
    metres_per_pixel: float | None = None

    @property
    def cell(self) -> tuple[str, str]:
        """Category and setup."""
        return self.category, self.setup

    @property
    def content(self) -> dict[str, Any]:
        """All that a result depends on but the picture's pixels."""
        return {
            "id": self.id,
            "instruction": self.instruction,
            "robots": self.robots,
            "cell": self.cell,
            "expects": self.expects,
            "goals": [_goal(goal) for goal in self.goals],
            "must_pass": self.must_pass,
            **({"metres_per_pixel": self.metres_per_pixel} if self.metres_per_pixel else {}),
        }


def _goal(goal: Task) -> dict[str, Any]:
    return {
        "robots": goal.robots,
        "size": goal.size,
        "target": _thing(goal.target),
        "other": goal.other and _thing(goal.other),
        "success": goal.success,
    }


def _thing(thing: Thing) -> list[Any]:
    return [thing.polygon, thing.holes]


@dataclass(frozen=True)
class Suite:
    """Tasks under a name."""

    name: str
    description: str
    tasks: tuple[SuiteTask, ...]

    def sha256(self, pixels: Mapping[str, str]) -> str:
        """The hash of its tasks with their pictures, by which results name it.

        Args:
            pixels: hash of the picture of each task, by the task's id.
        """
        tasks = sorted(self.tasks, key=lambda task: task.id)
        content = [[task.content, pixels[task.id]] for task in tasks]
        return hashlib.sha256(canonical([self.name, VERSION, content])).hexdigest()
