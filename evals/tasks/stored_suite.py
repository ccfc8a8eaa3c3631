"""What a run's folder keeps of its suite, so that the run can be looked at without the suite.

Of held-out tasks only the chance level is kept: nothing of what they ask, show or expect.
"""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from ...tools.errors import InputError
from ...tools.store import write_whole
from ...tools.tool import violations
from ..experiments.journal import MANIFEST, read_manifest
from ..experiments.trials import Sha
from ..statistics.cells import Chance
from .rendered_pictures import RenderedPicture
from .task import Goal, Ring, Suite, Task

NAME, PICTURES, ATTEMPTS = "suite.json", "pictures", "attempts"
"""In a run's folder: its suite, the pictures drawn for it, what came of each trial."""
Point = tuple[float, float]


class _Value(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class StoredThing(_Value):
    """An object's true outline and holes, px of the picture."""

    name: str
    outline: tuple[Point, ...]
    holes: tuple[tuple[Point, ...], ...]


class StoredGoal(_Value):
    """So many robots about a thing, perhaps two, and the rule that says when it is done."""

    robots: int
    things: tuple[StoredThing, ...]
    success: dict[str, Any]


class StoredTask(_Value):
    """A task.

    Attributes:
        picture: its file, seen from the run's folder.
        pixels: hash of the picture's pixels.
    """

    id: str
    instruction: str
    category: str
    setup: str
    style: str
    referring: str
    robots: int | None
    expects: tuple[str, ...]
    goals: tuple[StoredGoal, ...]
    picture: str
    pixels: Sha


class StoredSuite(_Value):
    """A suite's split; the held-out one keeps no tasks.

    Attributes:
        chance: what the best policy without understanding scores, (SR, GCR), by cell.
    """

    name: str
    description: str
    split: str
    sha256: Sha
    chance: dict[str, tuple[float, float]]
    tasks: tuple[StoredTask, ...]

    @property
    def held_out(self) -> bool:
        """Whether scores are all that may be seen."""
        return self.split == "test"

    @property
    def levels(self) -> dict[str, Chance]:
        """The chance level by name of cell."""
        return {name: Chance(*level) for name, level in self.chance.items()}


def store_suite(
    folder: Path,
    suite: Suite,
    split: str,
    sha256: str,
    pictures: Mapping[str, RenderedPicture],
    levels: Mapping[str, Chance],
) -> None:
    """Write down the suite of a run; a folder of another suite, which is refused, is left alone.

    Args:
        folder: of the run.
        suite: what is run of it.
        split: that it is.
        sha256: by which results name it.
        pictures: the picture of each task, by its id.
        levels: of chance, by name of cell.

    Raises:
        InputError: it cannot be written.
    """
    if (folder / MANIFEST).exists() and read_manifest(folder).suite != sha256:
        return
    shown = [] if split == "test" else [task for task in suite.tasks if task.split != "test"]
    stored = StoredSuite(
        name=suite.name,
        description=suite.description,
        split=split,
        sha256=sha256,
        chance={name: (level.sr, level.gcr) for name, level in levels.items()},
        tasks=tuple(_stored_task(task, pictures[task.id], folder) for task in shown),
    )
    write_whole(folder / NAME, stored.model_dump_json().encode())


def read_suite(folder: Path) -> StoredSuite:
    """The stored suite of a run.

    Raises:
        InputError: there is none, it is damaged, or it is not that of the run's trials.
    """
    path = folder / NAME
    try:
        suite = StoredSuite.model_validate_json(path.read_bytes())
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror or error}; run the suite again into this folder, which "
            "writes it and repeats no trial."
        ) from None
    except ValidationError as error:
        raise InputError(f"{path} is damaged: {violations(error)}") from None
    if suite.sha256 != read_manifest(folder).suite:
        raise InputError(f"{path} is of another suite than the trials beside it.")
    return suite


def join_stored(folders: Sequence[Path], into: Path) -> None:
    """Put what runs keep beside their rows together, as far as they keep anything.

    Raises:
        InputError: it cannot be copied.
    """
    try:
        for folder in folders:
            for name in (PICTURES, ATTEMPTS):
                if (folder / name).is_dir():
                    shutil.copytree(folder / name, into / name, dirs_exist_ok=True)
            if (folder / NAME).is_file() and not (into / NAME).exists():
                shutil.copyfile(folder / NAME, into / NAME)
    except OSError as error:
        raise InputError(f"{into}: {error.strerror or error}.") from None


def _stored_task(task: Task, picture: RenderedPicture, folder: Path) -> StoredTask:
    return StoredTask(
        id=task.id,
        instruction=task.instruction,
        category=task.category,
        setup=task.setup,
        style=task.style,
        referring=task.referring,
        robots=task.robots,
        expects=task.expects,
        goals=tuple(_stored_goal(goal) for goal in task.goals),
        picture=_seen_from(folder, picture.path),
        pixels=picture.pixels,
    )


def _stored_goal(goal: Goal) -> StoredGoal:
    things = tuple(
        StoredThing(name=t.name, outline=_ring_of(t.polygon), holes=tuple(map(_ring_of, t.holes)))
        for t in goal.things
    )
    return StoredGoal(robots=goal.robots, things=things, success=goal.success)


def _ring_of(points: Ring) -> tuple[Point, ...]:
    return tuple((float(x), float(y)) for x, y in points)


def _seen_from(folder: Path, picture: Path) -> str:
    """Inside the folder as it is, which may be moved; else where it lies."""
    inside = picture.is_relative_to(folder)
    return (picture.relative_to(folder) if inside else picture.resolve()).as_posix()
