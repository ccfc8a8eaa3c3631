"""The pictures of a suite as files, drawn where they are not there yet, and what they hash to."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...tools.perception.image import Picture, load_picture
from .suite_task import Drawing, SuiteTask


@dataclass(frozen=True)
class Hung:
    """A picture's file and the hash of its pixels."""

    path: Path
    pixels: str


def hang(
    tasks: Sequence[SuiteTask], folder: Path, told: Callable[[], None] = lambda: None
) -> dict[str, Hung]:
    """The picture of each task, by its id.

    Args:
        tasks: whose pictures are wanted.
        folder: for those that are drawn; what is there already is used, and hashed as it is.
        told: called after each.

    Raises:
        ImageError: a file is no picture.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[Path, Hung] = {}
    hung: dict[str, Hung] = {}
    for task in tasks:
        path = task.picture
        if isinstance(path, Drawing):
            path = folder / path.name
        if path not in found:
            if isinstance(task.picture, Drawing) and not path.exists():
                part = path.with_suffix(".part")
                task.picture.image().save(part, format="PNG", compress_level=1)
                part.replace(path)
            found[path] = Hung(path, hashed(load_picture(path)))
        hung[task.id] = found[path]
        told()
    return hung


def hashed(picture: Picture) -> str:
    """SHA-256 of a picture's size and pixels, however its file holds them."""
    pixels = picture.pixels
    return hashlib.sha256(repr(pixels.shape).encode() + pixels.tobytes()).hexdigest()
