"""Drawings of things outdoors: cars, gardens, boats; the first part is the whole outline."""

import numpy as np
import shapely
from numpy.random import Generator
from shapely import affinity
from shapely.geometry import Polygon, box

from . import polygons as shapes
from .drawing import GLASS, boarded, dots_around, edged, shrunk
from .palette import RGB, lit
from .things import Part

WOOD: RGB = (150, 104, 62)


def car(random: Generator, colour: RGB) -> list[Part]:
    """A car from above, its bonnet to the right: mirrors, windows, lights."""
    wide = random.uniform(0.42, 0.48)
    body = shapes.rounded(box(-0.5, -wide / 2, 0.5, wide / 2), random.uniform(0.08, 0.14))
    mirrors = [box(0.1, s * wide / 2 - 0.03, 0.16, s * wide / 2 + 0.03) for s in (-1, 1)]
    outline = shapes.union([body, *mirrors])
    cabin = wide * 0.42
    front = Polygon([(0.1, -cabin), (0.22, -cabin * 0.92), (0.22, cabin * 0.92), (0.1, cabin)])
    back = Polygon([(-0.34, -cabin * 0.9), (-0.26, -cabin), (-0.26, cabin), (-0.34, cabin * 0.9)])
    sides = [box(-0.24, s * cabin - 0.012, 0.08, s * cabin + 0.012) for s in (-1, 1)]
    lamps = [box(0.45, s * wide * 0.34 - 0.03, 0.49, s * wide * 0.34 + 0.03) for s in (-1, 1)]
    rear = [box(-0.49, s * wide * 0.34 - 0.03, -0.46, s * wide * 0.34 + 0.03) for s in (-1, 1)]
    return [
        Part(outline, lit(colour, 0.8)),
        Part(body.buffer(-0.015), colour),
        Part(shapes.rounded(box(-0.25, -cabin, 0.1, cabin), 0.03), lit(colour, 1.12)),
        Part(shapely.union_all([front, back, *sides]), GLASS),
        Part(shapely.union_all(lamps), (250, 245, 215)),
        Part(shapely.union_all(rear), (150, 25, 25)),
    ]


def van(random: Generator, colour: RGB) -> list[Part]:
    """A van from above: a long box with a windscreen."""
    long = random.uniform(0.55, 0.62)
    body = shapes.rounded(box(-long, -0.24, long, 0.24), 0.05)
    screen = Polygon(
        [(long - 0.2, -0.21), (long - 0.1, -0.17), (long - 0.1, 0.17), (long - 0.2, 0.21)]
    )
    ribs = [box(x, -0.2, x + 0.012, 0.2) for x in np.linspace(-long + 0.1, long - 0.3, 5)]
    return [
        *edged(body, colour, 0.025, 0.75),
        Part(shapely.union_all(ribs), lit(colour, 0.85)),
        Part(screen, GLASS),
    ]


def pond(random: Generator, colour: RGB) -> list[Part]:
    """A pond of irregular shape: a bank, deeper water, a few leaves."""
    outline = affinity.scale(shapes.blob(random, 0.42), random.uniform(1.0, 1.5), 1)
    leaves = [
        shapes.circle(0.06, x, y)
        for x, y in random.uniform(-0.6, 0.6, (int(random.integers(0, 5)), 2))
    ]
    return [
        Part(outline, lit(colour, 0.8)),
        Part(outline.buffer(-0.07), colour),
        Part(shrunk(outline, 0.6), lit(colour, 0.88)),
        *[Part(leaf, (80, 140, 70)) for leaf in leaves],
    ]


def bush(random: Generator, colour: RGB) -> list[Part]:
    """A clipped bush: bumps lit from one side."""
    bumps = int(random.integers(9, 14))
    outline = shapes.scalloped(bumps, 0.12)
    places = random.uniform(-0.7, 0.7, (26, 2))
    tufts = [shapes.circle(random.uniform(0.08, 0.16), x, y) for x, y in places]
    return [
        Part(outline, lit(colour, 0.8)),
        Part(shrunk(outline, 0.88), colour),
        *[Part(tuft, lit(colour, random.uniform(0.82, 1.25))) for tuft in tufts],
    ]


def stone(random: Generator, colour: RGB) -> list[Part]:
    """A stone with a lit face."""
    outline = affinity.scale(shapes.blob(random, 0.25), random.uniform(1, 1.3), 1)
    face = affinity.translate(shrunk(outline, 0.7), -0.1, -0.12)
    return [
        Part(outline, lit(colour, 0.82)),
        Part(shrunk(outline, 0.9), colour),
        Part(face, lit(colour, 1.06)),
    ]


def bed(random: Generator, colour: RGB) -> list[Part]:
    """A flower bed: dark soil dotted with flowers."""
    outline = shapes.rounded(shapes.rectangle(random.uniform(1.5, 2.0)), 0.03)
    flowers: list[RGB] = [(225, 60, 80), (245, 210, 70), (235, 235, 240), (190, 90, 190)]
    dots = [
        shapes.circle(0.045, x, y) for x, y in random.uniform((-0.9, -0.42), (0.9, 0.42), (34, 2))
    ]
    return [
        *edged(outline, colour, 0.03, 1.5),
        *[Part(dot, flowers[random.integers(len(flowers))]) for dot in dots],
    ]


def parasol(random: Generator, colour: RGB) -> list[Part]:
    """A parasol from above: eight panels, every other one darker."""
    outline = shapes.regular(8)
    points = shapely.get_coordinates(outline)
    panels = [Polygon([(0, 0), points[i], points[i + 1]]) for i in range(0, 8, 2)]
    return [
        Part(outline, colour),
        Part(shapely.union_all(panels), lit(colour, 0.85)),
        Part(shapes.circle(0.07), lit(colour, 0.5)),
    ]


def pot(random: Generator, colour: RGB) -> list[Part]:
    """A flower pot from above: a broad rim around soil and a few leaves."""
    leaves = [
        affinity.rotate(affinity.translate(shrunk(shapes.oval(2.2), 0.09), 0.22, 0), a, (0, 0))
        for a in np.linspace(0, 300, 6) + random.uniform(0, 60)
    ]
    return [
        Part(shapes.circle(), lit(colour, 0.8)),
        Part(shapes.circle(0.96), colour),
        Part(shapes.circle(0.55), (62, 44, 32)),
        Part(shapely.union_all(leaves), (90, 150, 70)),
    ]


def bench(random: Generator, colour: RGB) -> list[Part]:
    """A bench: three boards."""
    ratio = random.uniform(2.6, 3.3)
    boards = [box(-ratio / 2, y, ratio / 2, y + 0.29) for y in (-0.5, -0.145, 0.21)]
    return boarded(ratio, 0.6, boards, colour)


def hedge(random: Generator, colour: RGB) -> list[Part]:
    """A hedge cut in the shape of a C."""
    outline = shapes.cee(random.uniform(0.4, 0.5), random.uniform(70, 110))
    tufts = dots_around(random, 40, (0.6, 0.95), 0.07)
    return [
        *edged(outline, colour, 0.04, 0.75),
        *[Part(tuft, lit(colour, random.uniform(0.82, 1.2))) for tuft in tufts],
    ]


def boat(random: Generator, colour: RGB) -> list[Part]:
    """An open boat: a gunwale, a deck and thwarts."""
    ratio = random.uniform(2.3, 2.8)
    outline = shapes.hull(ratio, random.uniform(0.55, 0.75))
    inner = outline.buffer(-0.1)
    seats = [
        box(x, -0.5, x + 0.13, 0.5).intersection(inner) for x in (-0.3 * ratio, 0.0, 0.15 * ratio)
    ]
    return [
        Part(outline, colour),
        Part(inner, lit(colour, 0.7)),
        Part(shapely.union_all(seats), lit(WOOD, 1.25)),
    ]


def motorboat(random: Generator, colour: RGB) -> list[Part]:
    """A motor boat: a decked bow, a screen and a cockpit."""
    ratio = random.uniform(2.1, 2.5)
    outline = shapes.hull(ratio, 0.8)
    cockpit = shapes.rounded(box(-0.4 * ratio, -0.3, 0.05 * ratio, 0.3), 0.08)
    screen = Polygon(
        [(0.05 * ratio, -0.34), (0.14 * ratio, -0.2), (0.14 * ratio, 0.2), (0.05 * ratio, 0.34)]
    )
    return [
        *edged(outline, colour, 0.03, 0.8),
        Part(cockpit, lit(colour, 0.72)),
        Part(screen, GLASS),
    ]


def buoy(random: Generator, colour: RGB) -> list[Part]:
    """A buoy: a float with a band and a top mark."""
    return [
        Part(shapes.circle(), lit(colour, 0.78)),
        Part(shapes.circle(0.9), colour),
        Part(shapes.circle(0.42), lit(colour, 0.7)),
        Part(shapes.circle(0.3, -0.05, -0.05), lit(colour, 1.2)),
    ]


def raft(random: Generator, colour: RGB) -> list[Part]:
    """A raft of planks."""
    ratio = random.uniform(1.15, 1.4)
    planks = [box(-ratio / 2, y, ratio / 2, y + 0.17) for y in np.linspace(-0.5, 0.33, 5)]
    return boarded(ratio, 0.6, planks, colour)


def jetty(random: Generator, colour: RGB) -> list[Part]:
    """A long jetty of boards."""
    ratio = random.uniform(3.6, 4.6)
    boards = [box(x + 0.03, -0.5, x + 0.2, 0.5) for x in np.arange(-ratio / 2, ratio / 2, 0.22)]
    return boarded(ratio, 0.7, boards, colour)


def lifebuoy(random: Generator, colour: RGB) -> list[Part]:
    """A swimming ring with four pale bands."""
    outline = shapes.annulus(random.uniform(0.45, 0.55))
    band = shapely.union_all([box(-1.1, -0.13, 1.1, 0.13), box(-0.13, -1.1, 0.13, 1.1)])
    pale: RGB = (240, 238, 232) if max(colour) - min(colour) > 60 else (205, 60, 45)
    return [*edged(outline, colour, 0.03, 0.8), Part(band, pale)]
