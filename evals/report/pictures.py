"""Pictures for the page: each once, scaled down, as a JPEG inside the file."""

import base64
import io
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from ...tools.errors import ImageError
from ...tools.perception.image import load_picture
from ..tasks.rendered_pictures import RenderedPicture, pixel_hash
from ..tasks.stored_suite import StoredSuite
from ..tasks.task import Task

LONG = 900
"""Most pixels along the longer side."""
QUALITY = 80
MARGIN = 20
"""Margin around the true outlines if the picture is missing, px."""


@dataclass(frozen=True)
class PagePicture:
    """A picture that the page holds.

    Attributes:
        id: by which the page names it; empty if the picture is missing.
        size: of the original, (width, height) px, in whose pixels positions are.
        data: the JPEG file.
    """

    id: str
    size: tuple[int, int]
    data: bytes = b""

    @property
    def url(self) -> str:
        """The file itself as a data URL."""
        return f"data:image/jpeg;base64,{base64.b64encode(self.data).decode()}"


def pictures(folder: Path, suite: StoredSuite) -> dict[str, PagePicture]:
    """Return the pictures of a suite's tasks by the hash of their pixels.

    One that is missing, or has changed, is left blank.
    """
    found: dict[str, PagePicture] = {}
    for task in suite.tasks:
        source = suite.pictures[task.id]
        if source.pixels not in found:
            name = f"picture-{len(found) + 1}"
            found[source.pixels] = _page_picture(folder, source, task, name)
    return found


def _page_picture(folder: Path, source: RenderedPicture, task: Task, name: str) -> PagePicture:
    try:
        picture = load_picture(folder / source.path)
    except ImageError:
        return PagePicture("", _extent(task))
    if pixel_hash(picture) != source.pixels:
        return PagePicture("", picture.size)
    image = Image.fromarray(picture.pixels)
    image.thumbnail((LONG, LONG), Image.Resampling.LANCZOS)
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY, optimize=True)
    return PagePicture(name, picture.size, file.getvalue())


def _extent(task: Task) -> tuple[int, int]:
    """Return a size, (width, height) px, that holds the true outlines of a missing picture."""
    points = [point for thing in task.things for point in thing.polygon]
    right, low = (int(max((p[axis] for p in points), default=99.0)) for axis in (0, 1))
    return right + MARGIN, low + MARGIN
