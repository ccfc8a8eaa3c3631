"""Drawing of a scene: ground, marks, shadows, things, light and camera.

Ground, things and camera have random streams of their own. Three pixels of the drawing make one
of the picture; pixel x of the picture is centred on pixel 3 x + 1 of the drawing.
"""

import io
import math
from collections.abc import Callable, Iterable

import numpy as np
import shapely
from numpy.random import Generator
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter
from shapely.geometry import Polygon

from .palette import RGB
from .things import Look, Part, Scene

FINE = 3
Floats = NDArray[np.floating]
Size = tuple[int, int]


def draw(scene: Scene) -> Image.Image:
    """Draw the picture of a scene, RGB; the same scene gives the same pixels."""
    ground_random, thing_random, camera_random = (
        np.random.default_rng([scene.seed, 1, step]) for step in range(3)
    )
    ground = scene.ground
    canvas = TEXTURES[ground.texture](ground_random, scene.size, ground.colour)
    if ground.marks:
        colour, cover = layer(scene.size, ground.marks)
        cover = cover * (0.85 + 0.3 * _smooth(ground_random, scene.size, 6))
        canvas += np.clip(cover, 0, 1)[..., None] * (colour - canvas)
    colour, cover = layer(scene.size, [part for t in scene.things for part in t.parts])
    if scene.look.shadow:
        canvas *= _shade(cover, scene.look.shadow)[..., None]
    texture = 0.6 * _smooth(thing_random, scene.size, 9) + 0.4 * _smooth(
        thing_random, scene.size, 2
    )
    colour *= 1 + scene.look.grain * texture[..., None]
    canvas += cover[..., None] * (colour - canvas)
    canvas *= _light(scene.size, scene.look)[..., None]
    return _camera(camera_random, canvas, scene.look)


def layer(size: Size, parts: Iterable[Part]) -> tuple[Floats, Floats]:
    """Return the colour (h, w, 3) and cover (h, w), 0 to 1, of parts drawn one over the other."""
    fine = Image.new("RGBA", (FINE * size[0], FINE * size[1]))
    pen = ImageDraw.Draw(fine)
    for part in parts:
        red, green, blue = (round(channel) for channel in part.colour)
        for region in shapely.get_parts(part.region):
            if isinstance(region, Polygon) and not region.is_empty:
                _fill(fine, pen, region, (red, green, blue, 255))
    pixels = np.asarray(fine.reduce(FINE), dtype=np.float32)
    return pixels[..., :3].copy(), pixels[..., 3] / 255


def _fill(
    fine: Image.Image, pen: ImageDraw.ImageDraw, region: Polygon, colour: tuple[int, int, int, int]
) -> None:
    rings = [np.rint(FINE * np.asarray(r.coords) + 1) for r in (region.exterior, *region.interiors)]
    if len(rings) == 1:
        pen.polygon(rings[0].ravel().tolist(), fill=colour)
        return
    x0, y0 = (int(v) for v in np.floor(rings[0].min(axis=0)) - 1)
    x1, y1 = (int(v) for v in np.ceil(rings[0].max(axis=0)) + 2)
    mask = Image.new("L", (x1 - x0, y1 - y0))
    holed = ImageDraw.Draw(mask)
    for i, ring in enumerate(rings):
        holed.polygon((ring - (x0, y0)).ravel().tolist(), fill=0 if i else 255)
    fine.paste(colour, (x0, y0, x1, y1), mask)


def _shade(cover: Floats, shadow: tuple[float, float, float, float]) -> Floats:
    dx, dy, blur, strength = shadow
    mask = Image.fromarray((255 * cover).astype(np.uint8))
    mask = mask.transform(mask.size, Image.Transform.AFFINE, (1, 0, -dx, 0, 1, -dy))
    mask = mask.filter(ImageFilter.GaussianBlur(blur))
    return 1 - strength * np.asarray(mask, dtype=np.float32) / 255


def _light(size: Size, look: Look) -> Floats:
    x, y = np.meshgrid(np.linspace(-1, 1, size[0]), np.linspace(-1, 1, size[1]))
    way = math.radians(look.way)
    return (1 + look.light * (math.cos(way) * x + math.sin(way) * y) / 1.4).astype(np.float32)


def _camera(random: Generator, canvas: Floats, look: Look) -> Image.Image:
    if look.blur:
        image = _to_image(canvas).filter(ImageFilter.GaussianBlur(look.blur))
        canvas = np.asarray(image, dtype=np.float32)
    noise = random.standard_normal(canvas.shape, dtype=np.float32)
    image = _to_image(canvas + look.noise * noise)
    if look.jpeg:
        stored = io.BytesIO()
        image.save(stored, "JPEG", quality=look.jpeg)
        image = Image.open(stored).convert("RGB")
    return image


def _to_image(canvas: Floats) -> Image.Image:
    return Image.fromarray(np.clip(np.rint(canvas), 0, 255).astype(np.uint8))


def _smooth(random: Generator, size: Size, across: float, down: float | None = None) -> Floats:
    """Return noise, -0.5 to 0.5, (h, w), whose spots are so many pixels wide and high."""
    w, h = math.ceil(size[0] / across) + 3, math.ceil(size[1] / (down or across)) + 3
    coarse = Image.fromarray(random.random((h, w), dtype=np.float32) - 0.5)
    wide, high = math.ceil(w * across), math.ceil(h * (down or across))
    fine = coarse.resize((wide, high), Image.Resampling.BICUBIC)
    return np.asarray(fine, dtype=np.float32)[: size[1], : size[0]]


def _toned(brightness: Floats, colour: RGB) -> Floats:
    return brightness.astype(np.float32)[..., None] * np.asarray(colour, dtype=np.float32)


def _flat(random: Generator, size: Size, colour: RGB) -> Floats:
    return _toned(np.ones(size[::-1], dtype=np.float32), colour)


def _paper(random: Generator, size: Size, colour: RGB) -> Floats:
    return _toned(1 + 0.07 * _smooth(random, size, 3) + 0.08 * _smooth(random, size, 90), colour)


def _asphalt(random: Generator, size: Size, colour: RGB) -> Floats:
    rough = 0.3 * _smooth(random, size, 1.5) + 0.2 * _smooth(random, size, 4)
    worn = 0.22 * _smooth(random, size, 70) + 0.1 * _smooth(random, size, 25)
    return _toned(1 + rough + worn, colour)


def _concrete(random: Generator, size: Size, colour: RGB) -> Floats:
    worn = 0.12 * _smooth(random, size, 60) + 0.1 * _smooth(random, size, 15)
    return _toned(
        1 + worn + 0.08 * _smooth(random, size, 1.5) - 0.25 * _joints(random, size, 2), colour
    )


def _tiles(random: Generator, size: Size, colour: RGB) -> Floats:
    return _toned(1 + 0.06 * _smooth(random, size, 2) - 0.2 * _joints(random, size, 3), colour)


def _joints(random: Generator, size: Size, width: int) -> Floats:
    """Return an image (h, w) that is 1 on the joints of a grid of slabs, else 0."""
    cell, shift = int(random.integers(70, 170)), random.integers(0, 70, 2)
    x, y = np.arange(size[0]) + shift[0], np.arange(size[1]) + shift[1]
    joint = (x[None] % cell < width) | (y[:, None] % cell < width)
    return joint.astype(np.float32)


def _wood(random: Generator, size: Size, colour: RGB) -> Floats:
    if random.random() < 0.5:
        return _wood(random, (size[1], size[0]), colour).transpose(1, 0, 2)
    wide = int(random.integers(60, 140))
    plank = np.arange(size[1]) // wide
    tone = random.uniform(-0.07, 0.07, int(plank[-1]) + 1)[plank]
    seam = (np.arange(size[1]) % wide < 2) * -0.35
    grain = 0.3 * _smooth(random, size, 140, 3) + 0.16 * _smooth(random, size, 60, 1.5)
    return _toned(1 + grain + (tone + seam)[:, None].astype(np.float32), colour)


def _checks(random: Generator, size: Size, colour: RGB) -> Floats:
    cell, depth = int(random.integers(18, 44)), random.uniform(0.06, 0.16)
    x, y = np.arange(size[0]) // cell % 2, np.arange(size[1]) // cell % 2
    woven = depth * (x[None] + y[:, None] - 1)
    return _toned(1 + woven.astype(np.float32) + 0.08 * _smooth(random, size, 1.5), colour)


def _grass(random: Generator, size: Size, colour: RGB) -> Floats:
    blades = 0.4 * _smooth(random, size, 1.5, 4) + 0.22 * _smooth(random, size, 5)
    tone = _toned(1 + blades + 0.2 * _smooth(random, size, 50), colour)
    tone[..., 0] *= 1 + 0.2 * _smooth(random, size, 30)
    return tone


def _gravel(random: Generator, size: Size, colour: RGB) -> Floats:
    return _toned(1 + 0.3 * _smooth(random, size, 3) + 0.3 * _smooth(random, size, 5), colour)


def _water(random: Generator, size: Size, colour: RGB) -> Floats:
    y = np.arange(size[1], dtype=np.float32)[:, None]
    length = random.uniform(14, 30)
    bent = y + 1.6 * length * _smooth(random, size, 90, 40)
    waves = np.sin(2 * math.pi * bent / length) * (0.5 + _smooth(random, size, 50, 12))
    glint = np.clip(_smooth(random, size, 26, 5) - 0.33, 0, 1)
    return _toned(1 + 0.1 * waves + 0.9 * glint + 0.15 * _smooth(random, size, 120), colour)


TEXTURES: dict[str, Callable[[Generator, Size, RGB], Floats]] = {
    "flat": _flat,
    "paper": _paper,
    "asphalt": _asphalt,
    "concrete": _concrete,
    "tiles": _tiles,
    "wood": _wood,
    "checks": _checks,
    "grass": _grass,
    "gravel": _gravel,
    "water": _water,
}
