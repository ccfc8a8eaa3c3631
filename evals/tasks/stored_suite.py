"""The copy of a suite in a run's folder, so that the run can be viewed without the original.

Of held-out tasks only the chance level is stored: nothing of what they ask, show or expect.
"""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from ...tools.errors import InputError
from ...tools.store import write_whole
from ...tools.tool import violations
from ..experiments.journal import MANIFEST, read_manifest
from ..experiments.trials import Sha
from ..statistics.cells import Chance
from .rendered_pictures import RenderedPicture
from .task import Suite, Task

NAME, PICTURES, ATTEMPTS = "suite.json", "pictures", "attempts"
"""In a run's folder: its suite, the pictures drawn for it, the results of its trials."""


class StoredSuite(BaseModel):
    """A stored split of a suite; the held-out one has no tasks.

    Attributes:
        chance: what the best policy without understanding scores, by cell.
        pictures: of the tasks, by id; paths as seen from the run's folder.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    description: str
    split: str
    sha256: Sha
    chance: dict[str, Chance]
    tasks: tuple[Task, ...]
    pictures: dict[str, RenderedPicture]

    @property
    def held_out(self) -> bool:
        """Whether nothing but scores may be shown."""
        return self.split == "test"


def store_suite(
    folder: Path,
    suite: Suite,
    split: str,
    sha256: str,
    pictures: Mapping[str, RenderedPicture],
    levels: Mapping[str, Chance],
) -> None:
    """Store the suite of a run; a folder of another suite, which the run refuses, is left alone.

    Args:
        folder: of the run.
        suite: with the tasks that are run.
        split: the name of the split that is run.
        sha256: by which results name it.
        pictures: the picture of each task, by its id.
        levels: chance levels by name of cell.

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
        chance=dict(levels),
        tasks=tuple(shown),
        pictures={task.id: _seen_from(folder, pictures[task.id]) for task in shown},
    )
    write_whole(folder / NAME, stored.model_dump_json().encode())


def read_suite(folder: Path) -> StoredSuite:
    """Return the stored suite of a run.

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
    """Copy what runs store beside their rows into one folder, as far as they store anything.

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


def _seen_from(folder: Path, picture: RenderedPicture) -> RenderedPicture:
    """Return it with a path relative to the folder, which may be moved, or absolute if outside."""
    path = picture.path
    inside = path.is_relative_to(folder)
    return RenderedPicture(path.relative_to(folder) if inside else path.resolve(), picture.pixels)
