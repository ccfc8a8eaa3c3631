"""The frame in which a model writes coordinates, found by asking it for five marks in a picture.

Some write rows before columns, on a grid of 1,000 whatever the picture's size, as shares, or in
pixels of the picture as it was scaled down for them. Graded as pixels these would fail for no
fault in what they see, and fake the paper's zeros.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from pydantic import BaseModel

from ...agent.agent import Agent
from ...agent.outcomes import Stopped
from ...tools.context import Settings
from ...tools.errors import InputError
from ...tools.geometry.outline import FloatArray
from ...tools.perception.image import load_picture
from ...tools.store import write_whole
from .written import Positions, written_positions

SIZE = (1300, 700)
MARKS = {
    "red": (0.12, 0.17),
    "green": (0.86, 0.11),
    "blue": (0.33, 0.52),
    "yellow": (0.71, 0.68),
    "black": (0.21, 0.89),
}
"""Positions of the discs by colour, as shares of the picture; no two are alike in any frame."""
ASKED = (
    f"Place {len(MARKS)} robots, one exactly on the middle of each disc, in this order: "
    f"{', '.join(MARKS)}."
)
RADIUS = 14
MOST = 0.02
"""Largest error, as a share of the diagonal, at which a frame counts as known."""
FILE, PICTURE = "frames.json", "marks.png"


class Frame(BaseModel, frozen=True):
    """How written numbers become pixels.

    Attributes:
        swapped: whether y is written before x.
        parts: into how many each side is divided, such as 1000; 0 for pixels.
        long: longer side of the resized picture whose pixels they are, px; 0 for the real one.
    """

    swapped: bool = False
    parts: int = 0
    long: int = 0

    @property
    def name(self) -> str | None:
        """Its name in results; None for the usual one."""
        order = ["y before x"] if self.swapped else []
        shares = [f"0 to {self.parts}"] if self.parts else []
        resized = [f"pixels of {self.long}"] if self.long else []
        return ", ".join(order + shares + resized) or None

    def pixels(self, written: Positions, size: tuple[int, int]) -> Positions:
        """Return the positions in pixels of a picture of a size, (width, height)."""
        points = np.asarray(written, dtype=float).reshape(-1, 2)
        points = points[:, ::-1] if self.swapped else points
        if self.parts:
            points = points * np.asarray(size) / self.parts
        elif self.long:
            points = points * max(size) / self.long
        return tuple((float(x), float(y)) for x, y in points)


PIXELS = Frame()


class Calibration(BaseModel):
    """The frame of a model, and the largest error of its marks as a share of the diagonal."""

    frame: Frame
    error: float

    @property
    def comparable(self) -> bool:
        """Whether the frame is known well enough to tell where the model means."""
        return self.error <= MOST


class _File(BaseModel):
    models: dict[str, Calibration] = {}


def frame_of(written: Positions) -> Calibration:
    """Return the frame in which marks were written: the plainest that fits, else the nearest."""
    truth = np.array(list(MARKS.values())) * SIZE
    found = list[Calibration]()
    for frame in _frames(written, truth):
        off = np.linalg.norm(np.asarray(frame.pixels(written, SIZE)) - truth, axis=1)
        found.append(Calibration(frame=frame, error=float(off.max() / np.hypot(*SIZE))))
        if found[-1].comparable:
            return found[-1]
    return min(found, key=lambda made: made.error)


def calibrate(agent: Agent, model: str, folder: Path) -> Calibration:
    """Return the frame of a model, which is asked once in each run and stored in its folder.

    Args:
        agent: the model alone, under the prompt of the run.
        model: its name.
        folder: of the run.

    Raises:
        InputError: no frame can be read from its answer, or it could not be asked.
    """
    path = folder / FILE
    known = _File.model_validate_json(path.read_bytes()) if path.exists() else _File()
    if model not in known.models:
        run = agent.run(
            load_picture(_picture_of_marks(folder)), ASKED, settings=Settings(robots=len(MARKS))
        )
        if isinstance(run.outcome, Stopped):
            raise InputError(f"{model} could not be asked for its frame: {run.outcome.reason}")
        written = written_positions(run.report.message) or ()
        if len(written) != len(MARKS):
            raise InputError(f"{model} gave {len(written)} places for {len(MARKS)} marks.")
        known.models[model] = frame_of(written)
        write_whole(path, known.model_dump_json(indent=1).encode())
    return known.models[model]


def _frames(written: Positions, truth: FloatArray) -> Iterator[Frame]:
    """Yield the frames that are possible, the plainest first."""
    for swapped in (False, True):
        yield Frame(swapped=swapped)
        for parts in (1000, 1, 100):
            yield Frame(swapped=swapped, parts=parts)
    for swapped in (False, True):
        points = np.asarray(Frame(swapped=swapped).pixels(written, SIZE))
        scale = float((points * truth).sum() / max(float((points**2).sum()), 1e-9))
        yield Frame(swapped=swapped, long=max(round(max(SIZE) / max(scale, 1e-9)), 1))


def _picture_of_marks(folder: Path) -> Path:
    """Draw the picture of the marks into a folder, and return its path."""
    image = Image.new("RGB", SIZE, (225, 225, 225))
    draw = ImageDraw.Draw(image)
    for colour, (x, y) in MARKS.items():
        middle = (round(x * SIZE[0]), round(y * SIZE[1]))
        draw.circle(middle, RADIUS, fill=colour)
    folder.mkdir(parents=True, exist_ok=True)
    image.save(folder / PICTURE)
    return folder / PICTURE
