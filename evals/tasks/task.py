"""Tasks and suites of tasks as values, and the hash by which results name a suite."""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, get_args

import shapely
from PIL import Image
from shapely.geometry import Polygon

from ...agent.report import Status
from ...tools.geometry.outline import Outline, make_outline
from ..experiments.trials import canonical
from ..grading.grades import VERSION
from ..scenes.paint import draw
from ..scenes.stories import story_of
from .recipes.inscribed import inscribe

Split = Literal["train", "dev", "test"]
SPLITS: tuple[Split, ...] = get_args(Split)
Ring = list[list[float]]


@dataclass(frozen=True)
class Thing:
    """An annotated object: its name, and its outline in pixels of the stored image."""

    id: str
    name: str
    polygon: Ring
    holes: list[Ring]

    @cached_property
    def outline(self) -> Outline:
        """The outline as geometry."""
        return make_outline(self.polygon, tuple(self.holes))

    @cached_property
    def region(self) -> Polygon:
        """The region it covers, without its holes."""
        return Polygon(self.polygon, self.holes)

    def overlap(self, found: Polygon) -> float:
        """Return the intersection over union of a found outline with the true one."""
        truth = shapely.make_valid(self.region)
        return float(found.intersection(truth).area / max(found.union(truth).area, 1e-9))


@dataclass(frozen=True)
class Goal:
    """A number of robots to place about a thing, and the rule for when they stand right.

    Attributes:
        size: of the picture, (width, height), px.
        success: the rule; lengths in px.
        other: a second thing, if robots stand between two.
    """

    robots: int
    size: tuple[int, int]
    target: Thing
    success: dict[str, Any] = field(repr=False)
    other: Thing | None = None

    @property
    def things(self) -> tuple[Thing, ...]:
        """The target, and the other thing if there is one."""
        return (self.target,) if self.other is None else (self.target, self.other)


@dataclass(frozen=True)
class Turn:
    """What a person says in one turn of a dialogue, and the result it must have.

    Attributes:
        words: as typed.
        expect: the kind of result that is right, such as edit or ask; see grading/dialogue.py.
        checks: what must have changed and what must not, by name; see grading/dialogue_checks.py.
        point: where the person points meanwhile, (x, y) px, if anywhere.
    """

    words: str
    expect: str
    checks: dict[str, Any] = field(default_factory=dict[str, Any], repr=False)
    point: tuple[float, float] | None = None


@dataclass(frozen=True)
class Dialogue:
    """Several turns about things that the person points at.

    Attributes:
        things: those pointed at, t1 first.
        given: how many of them are pointed at from the start; the others are in later turns.
        size: of the picture, (width, height), px.
    """

    turns: tuple[Turn, ...]
    things: tuple[Thing, ...]
    given: int
    size: tuple[int, int]


@dataclass(frozen=True)
class Drawing:
    """A picture that is drawn by code: the scene of a seed, perhaps with words in it."""

    seed: int
    inscription: str = ""

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"scene_{self.seed:06d}{'_inscribed' if self.inscription else ''}.png"

    def image(self) -> Image.Image:
        """Draw the picture; the pixels are always the same."""
        story = story_of(self.seed)
        drawn = draw(story.scene)
        return inscribe(drawn, story, self.inscription) if self.inscription else drawn


@dataclass(frozen=True)
class Task:
    """One instruction on one picture, and what is right.

    Attributes:
        id: unique in its suite.
        robots: the number that the person sets; None leaves it to the words.
        family: of the picture; splits are by family, so that no scene is in two of them.
        style: how it is worded, or what is wrong with it.
        referring: the kind of reference that tells which thing is meant in a drawn scene.
        goals: all must be reached; none if nothing is to be placed.
        expects: statuses that are right.
        picture: a file, or one that is drawn by code.
        must_pass: it always succeeds; the gate holds new versions to it.
        metres_per_pixel: of the picture, given to the method; None if it has no scale.
        dialogue: turns that are said and graded one by one; None for a single instruction.
    """

    id: str
    instruction: str
    robots: int | None
    category: str
    setup: str
    family: str
    split: Split
    style: str
    referring: str
    goals: tuple[Goal, ...]
    expects: tuple[Status, ...]
    picture: Path | Drawing
    must_pass: bool = False
    metres_per_pixel: float | None = None
    dialogue: Dialogue | None = None

    @property
    def things(self) -> tuple[Thing, ...]:
        """The things robots are to be placed about, each once."""
        if self.dialogue is not None:
            return self.dialogue.things
        return tuple({thing.id: thing for goal in self.goals for thing in goal.things}.values())

    @property
    def content(self) -> dict[str, Any]:
        """All that a result depends on except the picture's pixels."""
        return {
            "id": self.id,
            "instruction": self.instruction,
            "robots": self.robots,
            "cell": (self.category, self.setup),
            "expects": self.expects,
            "goals": [_goal_content(goal) for goal in self.goals],
            "must_pass": self.must_pass,
            **({"metres_per_pixel": self.metres_per_pixel} if self.metres_per_pixel else {}),
            **({"dialogue": asdict(self.dialogue)} if self.dialogue else {}),
        }


def _goal_content(goal: Goal) -> dict[str, Any]:
    target, other = goal.target, goal.other
    return {
        "robots": goal.robots,
        "size": goal.size,
        "target": [target.polygon, target.holes],
        "other": other and [other.polygon, other.holes],
        "success": goal.success,
    }


@dataclass(frozen=True)
class Suite:
    """A named set of tasks."""

    name: str
    description: str
    tasks: tuple[Task, ...]

    def sha256(self, pixels: Mapping[str, str]) -> str:
        """Return the hash of its tasks with their pictures, by which results name it.

        Args:
            pixels: hash of the picture of each task, by the task's id.
        """
        tasks = sorted(self.tasks, key=lambda task: task.id)
        content = [[task.content, pixels[task.id]] for task in tasks]
        return hashlib.sha256(canonical([self.name, VERSION, content])).hexdigest()
