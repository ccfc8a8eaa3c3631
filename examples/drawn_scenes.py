"""Scenes as in the paper's simulations: a white ground, dark shapes, robots that are points.

python examples/drawn_scenes.py [car-park|cage|infill] [--watch, and what else formup run takes]
"""

import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from PIL import Image, ImageDraw

SIZE = (900, 600)
DARK, GREY = (35, 38, 44), (120, 124, 132)
Draw = ImageDraw.ImageDraw


def rectangle(
    draw: Draw, x: float, y: float, wide: float, high: float, degrees: float = 0.0
) -> None:
    """A dark rectangle around a point, turned."""
    turn = math.radians(degrees)
    corners = [(a * wide / 2, b * high / 2) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    draw.polygon(
        [
            (
                x + a * math.cos(turn) - b * math.sin(turn),
                y + a * math.sin(turn) + b * math.cos(turn),
            )
            for a, b in corners
        ],
        DARK,
    )


def car_park(draw: Draw) -> None:
    """Eight cars in two rows, one of them askew."""
    for i in range(4):
        rectangle(draw, 150 + 200 * i, 150, 70, 140)
        rectangle(draw, 150 + 200 * i, 440, 70, 140, 28 if i == 2 else 0)


def cage(draw: Draw) -> None:
    """Round things and one with corners."""
    for x, y, radius in ((180, 170, 60), (690, 150, 45), (730, 460, 75)):
        draw.ellipse((x - radius, y - radius, x + radius, y + radius), DARK)
    rectangle(draw, 360, 380, 170, 110, 20)


def infill(draw: Draw) -> None:
    """A large region and two small ones."""
    draw.polygon([(120, 130), (470, 90), (520, 330), (380, 500), (140, 430)], GREY)
    rectangle(draw, 690, 160, 110, 80)
    draw.ellipse((640, 360, 780, 500), DARK)


SCENES: dict[str, tuple[Callable[[Draw], None], str]] = {
    "car-park": (car_park, "Surround the incorrectly parked car at its corners with 4 robots"),
    "cage": (cage, "Cage the rectangle with 12 robots"),
    "infill": (infill, "Fill the largest shape with 10 robots"),
}
"""What is drawn, and what the robots are to do."""


def main(name: str = "car-park", *options: str) -> int:
    """Draw a scene and have its instruction carried out; what `formup run` exits with."""
    draw_it, instruction = SCENES[name]
    picture = Image.new("RGB", SIZE, "white")
    draw_it(ImageDraw.Draw(picture))
    path = Path(f"{name}.png")
    picture.save(path)
    command = [sys.executable, "-m", "formup", "run", str(path), instruction, *options]
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
