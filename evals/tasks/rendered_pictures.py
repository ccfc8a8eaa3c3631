"""The pictures of a suite as files, drawn if they do not exist yet, with their hashes."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...tools.perception.image import Picture, load_picture
from .task import Drawing, Task


@dataclass(frozen=True)
class RenderedPicture:
    """A picture's file and the hash of its pixels."""

    path: Path
    pixels: str


def render(
    tasks: Sequence[Task], folder: Path, done: Callable[[], None] = lambda: None
) -> dict[str, RenderedPicture]:
    """Return the picture of each task by its id; those that do not exist yet are drawn.

    Args:
        tasks: whose pictures are wanted.
        folder: for drawn pictures; a file that exists is used, and hashed as it is.
        done: called after each.

    Raises:
        ImageError: a file is no picture.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[Path, RenderedPicture] = {}
    rendered: dict[str, RenderedPicture] = {}
    for task in tasks:
        path = task.picture
        if isinstance(path, Drawing):
            path = folder / path.name
        if path not in found:
            if isinstance(task.picture, Drawing) and not path.exists():
                part = path.with_suffix(".part")
                task.picture.image().save(part, format="PNG", compress_level=1)
                part.replace(path)
            found[path] = RenderedPicture(path, pixel_hash(load_picture(path)))
        rendered[task.id] = found[path]
        done()
    return rendered


def pixel_hash(picture: Picture) -> str:
    """Return the SHA-256 of a picture's size and pixels, whatever the file's format."""
    pixels = picture.pixels
    return hashlib.sha256(repr(pixels.shape).encode() + pixels.tobytes()).hexdigest()
