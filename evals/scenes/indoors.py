"""Drawings of things on tables and floors; the first part is the whole outline."""

import math
from itertools import pairwise

import numpy as np
import shapely
from numpy.random import Generator
from shapely import affinity
from shapely.geometry import Polygon, box

from . import polygons as shapes
from .drawing import boarded, dots_around, edged, shrunk
from .palette import RGB, lit
from .things import Part


def plate(random: Generator, colour: RGB) -> list[Part]:
    """A plate: a rim around a well."""
    outline = shapes.circle()
    rim = random.uniform(0.6, 0.75)
    return [
        *edged(outline, colour, 0.02, 0.8),
        Part(shapes.circle(rim), lit(colour, 0.88)),
        Part(shapes.circle(rim - 0.04), lit(colour, 1.03)),
    ]


def coin(random: Generator, colour: RGB) -> list[Part]:
    """A coin: a raised rim and a device in the middle."""
    device = affinity.rotate(shapes.star(int(random.integers(4, 8)), 0.5), random.uniform(0, 90))
    return [
        Part(shapes.circle(), lit(colour, 0.72)),
        Part(shapes.circle(0.93), lit(colour, 1.1)),
        Part(shapes.circle(0.85), colour),
        Part(shrunk(device, 0.45), lit(colour, 0.8)),
    ]


def card(random: Generator, colour: RGB) -> list[Part]:
    """A card with a border and lines of print."""
    outline = shapes.rounded(shapes.rectangle(random.uniform(1.4, 1.6)), 0.06)
    lines = [box(-0.5, y, random.uniform(0.1, 0.5), y + 0.05) for y in (-0.2, 0, 0.2)]
    return [*edged(outline, colour, 0.025, 0.8), Part(shapely.union_all(lines), lit(colour, 0.65))]


def mug(random: Generator, colour: RGB) -> list[Part]:
    """A mug from above: a rim, a drink and a handle."""
    handle = shapes.rounded(box(0.85, -0.17, 1.55, 0.17), 0.12)
    drink: RGB = (70, 42, 25) if random.random() < 0.7 else (165, 110, 50)
    return [
        Part(shapes.union([shapes.circle(), handle]), colour),
        Part(shapes.circle(0.86), lit(colour, 0.75)),
        Part(shapes.circle(0.8), drink),
    ]


def carton(random: Generator, colour: RGB) -> list[Part]:
    """A box closed with a strip of tape."""
    ratio = random.uniform(1.0, 1.45)
    outline = shapes.rectangle(ratio)
    tape = box(-ratio / 2, -0.07, ratio / 2, 0.07)
    seam = box(-ratio / 2, -0.008, ratio / 2, 0.008)
    return [
        *edged(outline, colour, 0.025, 0.78),
        Part(tape, lit(colour, 1.18)),
        Part(seam, lit(colour, 0.6)),
    ]


def pencil(random: Generator, colour: RGB) -> list[Part]:
    """A pencil: rubber, shaft, sharpened tip."""
    tip = Polygon([(2.4, -0.3), (3.1, 0), (2.4, 0.3)])
    return [
        Part(shapes.union([box(-2.6, -0.3, 2.41, 0.3), tip]), colour),
        Part(box(-2.6, -0.1, 2.4, 0.1), lit(colour, 1.2)),
        Part(tip, (225, 190, 145)),
        Part(Polygon([(2.85, -0.2), (3.1, 0), (2.85, 0.2)]), (40, 40, 40)),
        Part(box(-2.6, -0.3, -2.2, 0.3), (225, 150, 150)),
    ]


def doughnut(random: Generator, colour: RGB) -> list[Part]:
    """A doughnut: a ring of dough, iced, with sprinkles."""
    hole = random.uniform(0.32, 0.42)
    outline = shapes.annulus(hole)
    icing = Polygon(shapes.circle(0.92).exterior, [shapes.circle(hole + 0.07).exterior])
    sprinkles = dots_around(random, 18, (hole + 0.15, 0.85), 0.03)
    return [
        Part(outline, lit(colour, 0.75)),
        Part(icing, colour),
        Part(shapely.union_all(sprinkles), lit(colour, 1.4)),
    ]


def crate(random: Generator, colour: RGB) -> list[Part]:
    """A crate: a frame of planks with a brace across."""
    outline = shapes.rectangle(1)
    gaps = [box(-0.38, y, 0.38, y + 0.02) for y in (-0.2, -0.02, 0.16)]
    brace = Polygon(
        [(-0.38, 0.26), (-0.38, 0.38), (-0.26, 0.38), (0.38, -0.26), (0.38, -0.38), (0.26, -0.38)]
    )
    return [
        *edged(outline, colour, 0.025, 0.6),
        Part(shapes.rectangle(1).buffer(-0.12), lit(colour, 0.85)),
        Part(shapely.union_all(gaps), lit(colour, 0.55)),
        Part(brace, lit(colour, 1.08)),
    ]


def pallet(random: Generator, colour: RGB) -> list[Part]:
    """A pallet: boards over dark gaps."""
    ratio, boards = random.uniform(1.2, 1.5), int(random.integers(5, 8))
    edges = np.linspace(-ratio / 2, ratio / 2, boards + 1)
    gap = 0.12 * ratio / boards
    slats = [
        box(a + gap * (i > 0), -0.5, b - gap * (i < boards - 1), 0.5)
        for i, (a, b) in enumerate(pairwise(edges))
    ]
    return boarded(ratio, 0.5, slats, colour)


def barrel(random: Generator, colour: RGB) -> list[Part]:
    """A drum from above: rims and a bung."""
    turn = random.uniform(0, 6.3)
    bung = shapes.circle(0.12, 0.55 * math.cos(turn), 0.55 * math.sin(turn))
    return [
        Part(shapes.circle(), lit(colour, 0.65)),
        Part(shapes.circle(0.93), lit(colour, 1.1)),
        Part(shapes.circle(0.82), colour),
        Part(bung, lit(colour, 0.5)),
    ]


def tank(random: Generator, colour: RGB) -> list[Part]:
    """A lying tank: a capsule with a bright back and bands."""
    ratio = random.uniform(2.3, 2.9)
    outline = shapes.capsule(ratio)
    bands = [box(x - 0.03, -0.5, x + 0.03, 0.5) for x in (-0.25 * ratio, 0.25 * ratio)]
    return [
        *edged(outline, colour, 0.04, 0.72),
        Part(box(-ratio / 2 + 0.4, -0.14, ratio / 2 - 0.4, 0.0), lit(colour, 1.2)),
        Part(shapely.union_all(bands), lit(colour, 0.7)),
    ]


def mat(random: Generator, colour: RGB) -> list[Part]:
    """A mat with a border and stripes."""
    ratio = random.uniform(1.3, 1.7)
    stripes = [
        box(x, -0.36, x + 0.05, 0.36) for x in np.linspace(-ratio / 2 + 0.2, ratio / 2 - 0.25, 6)
    ]
    return [
        Part(shapes.rectangle(ratio), lit(colour, 0.8)),
        Part(shapes.rectangle(ratio).buffer(-0.07), colour),
        Part(shapely.union_all(stripes), lit(colour, 0.88)),
    ]
