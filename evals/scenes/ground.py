"""Grounds of the families: a texture in a fitting colour, with marks that count as no things."""

import math
from pathlib import Path

import shapely
import yaml
from numpy.random import Generator
from shapely import affinity
from shapely.geometry import Polygon

from .palette import RGB, lit
from .things import Ground, Part

Size = tuple[int, int]
_COLOURS: dict[str, list[RGB]] = yaml.safe_load(
    (Path(__file__).parent / "grounds.yaml").read_text(encoding="utf-8")
)


def _grey(random: Generator, low: float, high: float) -> RGB:
    level, warm = random.uniform(low, high), random.uniform(-6, 8)
    return level + warm, level, level - warm


def _near_colour(random: Generator, colour: RGB, spread: float) -> RGB:
    red, green, blue = (channel * random.uniform(1 - spread, 1 + spread) for channel in colour)
    return lit((red, green, blue), 1)


def _one_of(random: Generator, material: str, spread: float) -> RGB:
    """Return a colour of that material, each channel up to the share `spread` off."""
    colours = _COLOURS[material]
    return _near_colour(random, colours[random.integers(len(colours))], spread)


def lot(random: Generator, size: Size) -> Ground:
    """Asphalt or pale concrete, with oil spots."""
    colour = _grey(random, 55, 110) if random.random() < 0.75 else _grey(random, 150, 185)
    return Ground("asphalt", colour, _specks(random, size, lit(colour, 0.75), 2.5))


def table(random: Generator, size: Size) -> Ground:
    """Wood, a checked or a plain cloth, with crumbs at times."""
    texture = str(random.choice(["wood", "wood", "checks", "paper"]))
    colour = _one_of(random, "wood" if texture == "wood" else "cloth", 0.08)
    crumbs = _specks(random, size, lit(colour, 1.25), 1.5) if random.random() < 0.4 else ()
    return Ground(texture, colour, crumbs)


def floor(random: Generator, size: Size) -> Ground:
    """Concrete with slabs and painted lines."""
    colour = _grey(random, 120, 190)
    marks = list(_specks(random, size, lit(colour, 0.8), 2))
    if random.random() < 0.6:
        paint: RGB = (225, 190, 50) if random.random() < 0.6 else (235, 235, 230)
        for _ in range(int(random.integers(1, 3))):
            marks.append(Part(_stripe(random, size, random.uniform(4, 8)), paint))
    return Ground("concrete", colour, tuple(marks))


def lawn(random: Generator, size: Size) -> Ground:
    """Grass, sometimes gravel, with a few fallen leaves."""
    if random.random() < 0.2:
        return Ground("gravel", _near_colour(random, (190, 178, 155), 0.06))
    colour = _near_colour(random, (112, 142, 78), 0.1)
    return Ground("grass", colour, _specks(random, size, (190, 170, 80), 1.8))


def water(random: Generator, size: Size) -> Ground:
    """Water of a harbour, with flecks of foam."""
    colour = _one_of(random, "water", 0.08)
    return Ground("water", colour, _specks(random, size, lit(colour, 1.3), 2))


def sheet(random: Generator, size: Size) -> Ground:
    """Flat colour, paper, tiles or checks, dusty at times."""
    texture = str(random.choice(["flat", "paper", "paper", "tiles", "checks"]))
    colour = _one_of(random, "sheet", 0.03)
    dust = _specks(random, size, lit(colour, 0.7), 1.3) if random.random() < 0.25 else ()
    return Ground(texture, colour, dust)


def bays(
    cells: list[tuple[float, float]], box: tuple[float, float], turn: float, colour: RGB
) -> tuple[Part, ...]:
    """Painted bays: lines on both long sides of each cell and across its head."""
    wide, high = box[0] / 2, box[1] / 2
    lines = shapely.union_all(
        [
            *[shapely.box(-wide, y - 1.3, wide, y + 1.3) for y in (-high, high)],
            shapely.box(wide - 2.6, -high, wide, high),
        ]
    )
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    return tuple(
        Part(affinity.affine_transform(lines, [c, -s, s, c, x, y]), colour) for x, y in cells
    )


def _stripe(random: Generator, size: Size, width: float) -> Polygon:
    w, h = size
    if random.random() < 0.5:
        x = random.uniform(0.05, 0.95) * w
        return shapely.box(x, -9, x + width, h + 9)
    y = random.uniform(0.05, 0.95) * h
    return shapely.box(-9, y, w + 9, y + width)


def _specks(random: Generator, size: Size, colour: RGB, radius: float) -> tuple[Part, ...]:
    places = random.uniform((0, 0), size, (int(random.integers(0, 14)), 2))
    return tuple(
        Part(shapely.Point(x, y).buffer(radius * random.uniform(0.5, 1.3), quad_segs=3), colour)
        for x, y in places
    )
