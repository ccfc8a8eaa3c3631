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
from .photographs import Task, Thing
from .rendered_pictures import Hung
from .suite_task import Suite, SuiteTask

NAME, PICTURES, ATTEMPTS = "suite.json", "pictures", "attempts"
"""In a run's folder: its suite, the pictures drawn for it, what came of each trial."""
Point = tuple[float, float]


class _Value(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class KeptThing(_Value):
    """An object's true outline and holes, px of the picture."""

    name: str
    outline: tuple[Point, ...]
    holes: tuple[tuple[Point, ...], ...]


class KeptGoal(_Value):
    """So many robots about a thing, perhaps two, and the rule that says when it is done."""

    robots: int
    things: tuple[KeptThing, ...]
    success: dict[str, Any]


class KeptTask(_Value):
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
    robots: int | None
    expects: tuple[str, ...]
    goals: tuple[KeptGoal, ...]
    picture: str
    pixels: Sha


class KeptSuite(_Value):
    """A suite's split; the held-out one keeps no tasks.

    Attributes:
        chance: what the best policy without understanding scores, (SR, GCR), by cell.
    """

    name: str
    description: str
    split: str
    sha256: Sha
    chance: dict[str, tuple[float, float]]
    tasks: tuple[KeptTask, ...]

    @property
    def held_out(self) -> bool:
        """Whether scores are all that may be seen."""
        return self.split == "test"

    @property
    def levels(self) -> dict[str, Chance]:
        """The chance level by name of cell."""
        return {name: Chance(*level) for name, level in self.chance.items()}


def keep_suite(
    folder: Path,
    suite: Suite,
    split: str,
    sha256: str,
    hung: Mapping[str, Hung],
    levels: Mapping[str, Chance],
) -> None:
    """Write down the suite of a run; a folder of another suite, which is refused, is left alone.

    Args:
        folder: of the run.
        suite: what is run of it.
        split: that it is.
        sha256: by which results name it.
        hung: the picture of each task, by its id.
        levels: of chance, by name of cell.

    Raises:
        InputError: it cannot be written.
    """
    if (folder / MANIFEST).exists() and read_manifest(folder).suite != sha256:
        return
    shown = [] if split == "test" else [task for task in suite.tasks if task.split != "test"]
    kept = KeptSuite(
        name=suite.name,
        description=suite.description,
        split=split,
        sha256=sha256,
        chance={name: (level.sr, level.gcr) for name, level in levels.items()},
        tasks=tuple(_kept(task, hung[task.id], folder) for task in shown),
    )
    write_whole(folder / NAME, kept.model_dump_json().encode())


def read_suite(folder: Path) -> KeptSuite:
    """What was kept of the suite of a run.

    Raises:
        InputError: nothing was, it is damaged, or it is not that of the run's trials.
    """
    path = folder / NAME
    try:
        suite = KeptSuite.model_validate_json(path.read_bytes())
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


def join_kept(folders: Sequence[Path], into: Path) -> None:
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


def _kept(task: SuiteTask, hung: Hung, folder: Path) -> KeptTask:
    return KeptTask(
        id=task.id,
        instruction=task.instruction,
        category=task.category,
        setup=task.setup,
        style=task.style,
        robots=task.robots,
        expects=task.expects,
        goals=tuple(_goal(goal) for goal in task.goals),
        picture=_seen_from(folder, hung.path),
        pixels=hung.pixels,
    )


def _goal(goal: Task) -> KeptGoal:
    things = tuple(_thing(thing) for thing in (goal.target, goal.other) if thing)
    return KeptGoal(robots=goal.robots, things=things, success=goal.success)


def _thing(thing: Thing) -> KeptThing:
    rings = [tuple((float(x), float(y)) for x, y in ring) for ring in (thing.polygon, *thing.holes)]
    return KeptThing(name=thing.name, outline=rings[0], holes=tuple(rings[1:]))


def _seen_from(folder: Path, picture: Path) -> str:
    """Inside the folder as it is, which may be moved; else where it lies."""
    inside = picture.is_relative_to(folder)
    return (picture.relative_to(folder) if inside else picture.resolve()).as_posix()
