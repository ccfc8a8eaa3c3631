"""The families of scenes: which things there are, in which colours, on which ground."""

from collections.abc import Callable

from numpy.random import Generator
from shapely.geometry import Polygon

from . import ground, indoors, outdoors
from . import polygons as shapes
from .drawing import plain
from .things import Family, Sort

PAINTS = ("red", "blue", "white", "yellow", "green", "orange", "black")
BRIGHT = ("red", "orange", "yellow", "green", "blue", "purple", "pink")


def _hoop(random: Generator) -> Polygon:
    return shapes.annulus(0.9)


def _surround(random: Generator) -> Polygon:
    return shapes.frame(random.uniform(1, 1.3), 0.055)


PARKING = Family(
    "parking",
    (
        Sort("car", (*PAINTS, "grey"), outdoors.car, 4, upright=True),
        Sort("van", ("white", "blue", "yellow", "red"), outdoors.van, 4, upright=True, scale=1.25),
    ),
    ground.lot,
    turns="aligned",
    rows=0.75,
    bays=True,
    beyond=("shape", "colour_shape", "inside", "round", "long", "odd_shape"),
)
TABLE = Family(
    "table",
    (
        Sort(
            "plate", ("white", "blue", "green", "red", "yellow", "black"), indoors.plate, scale=1.3
        ),
        Sort("coin", ("grey", "yellow", "orange"), indoors.coin, by_colour=False, scale=0.75),
        Sort("card", ("white", "blue", "pink", "yellow", "green"), indoors.card, 4, upright=True),
        Sort("mug", ("red", "white", "blue", "green", "orange", "purple"), indoors.mug),
        Sort(
            "box",
            ("brown", "white", "blue", "purple"),
            indoors.carton,
            4,
            upright=True,
            plural="boxes",
        ),
        Sort("pencil", ("yellow", "red", "blue", "green"), indoors.pencil, upright=True, scale=0.7),
        Sort("doughnut", ("pink", "brown", "white"), indoors.doughnut),
        Sort("hoop", ("red", "blue", "white", "black"), plain(_hoop), encloses=True),
    ),
    ground.table,
    rows=0.2,
)
WAREHOUSE = Family(
    "warehouse",
    (
        Sort("crate", ("brown", "green", "blue", "orange"), indoors.crate, 4, upright=True),
        Sort("pallet", ("brown", "blue", "yellow"), indoors.pallet, 4, upright=True, scale=1.15),
        Sort("barrel", ("blue", "red", "yellow", "green", "black"), indoors.barrel, scale=0.85),
        Sort("tank", ("white", "red", "green", "orange"), indoors.tank, upright=True, scale=1.2),
        Sort("mat", ("green", "blue", "black", "purple", "red"), indoors.mat, 4, upright=True),
        Sort("frame", ("yellow", "red", "black"), plain(_surround), 4, encloses=True),
    ),
    ground.floor,
    turns="either",
    rows=0.35,
)
GARDEN = Family(
    "garden",
    (
        Sort("pond", ("blue",), outdoors.pond, scale=1.6),
        Sort("bush", ("green",), outdoors.bush, plural="bushes"),
        Sort("stone", ("grey", "white"), outdoors.stone, scale=0.8),
        Sort("flower bed", ("brown",), outdoors.bed, 4, by_colour=False, upright=True, scale=1.3),
        Sort("parasol", ("red", "blue", "yellow", "white", "orange"), outdoors.parasol, scale=1.1),
        Sort("pot", ("orange", "blue", "white", "purple"), outdoors.pot, scale=0.8),
        Sort("bench", ("brown", "white", "red"), outdoors.bench, 4, upright=True),
        Sort("hedge", ("green",), outdoors.hedge, upright=True, scale=1.3),
        Sort("border", ("grey", "white"), plain(_surround), 4, encloses=True),
    ),
    ground.lawn,
    rows=0.15,
)
HARBOUR = Family(
    "harbour",
    (
        Sort("boat", ("white", "red", "yellow", "orange", "green"), outdoors.boat, upright=True),
        Sort("motorboat", ("white", "red", "black", "orange"), outdoors.motorboat, upright=True),
        Sort("buoy", ("red", "orange", "yellow", "white", "green"), outdoors.buoy, scale=0.75),
        Sort("raft", ("brown", "orange"), outdoors.raft, 4, upright=True),
        Sort("jetty", ("brown",), outdoors.jetty, 4, upright=True, scale=1.3, plural="jetties"),
        Sort("lifebuoy", ("orange", "white", "red"), outdoors.lifebuoy, scale=0.9),
        Sort("boom", ("orange", "yellow", "white"), plain(_hoop), encloses=True),
    ),
    ground.water,
    turns="either",
    rows=0.25,
)


def _plain_shape(
    word: str,
    polygon: Callable[[Generator], Polygon],
    corners: int = 0,
    *,
    upright: bool = True,
    plural: str = "",
    encloses: bool = False,
) -> Sort:
    colours = (*BRIGHT, "black", "white", "brown")
    return Sort(
        word,
        colours,
        plain(polygon),
        corners,
        upright=upright,
        shape=word,
        plural=plural,
        encloses=encloses,
    )


SHAPES = Family(
    "shapes",
    (
        _plain_shape("circle", lambda r: shapes.circle(), upright=False),
        _plain_shape("square", lambda r: shapes.rectangle(1), 4),
        _plain_shape("rectangle", lambda r: shapes.rectangle(r.uniform(1.7, 2.3)), 4),
        _plain_shape("triangle", lambda r: shapes.regular(3), 3),
        _plain_shape("pentagon", lambda r: shapes.regular(5), 5),
        _plain_shape("hexagon", lambda r: shapes.regular(6), 6, upright=False),
        _plain_shape("star", lambda r: shapes.star(5, r.uniform(0.42, 0.5))),
        _plain_shape("cross", lambda r: shapes.cross(r.uniform(0.55, 0.75)), plural="crosses"),
        _plain_shape("L shape", lambda r: shapes.ell(r.uniform(0.55, 0.75))),
        _plain_shape("T shape", lambda r: shapes.tee(r.uniform(0.55, 0.75))),
        _plain_shape("C shape", lambda r: shapes.cee(r.uniform(0.38, 0.5), r.uniform(60, 110))),
        _plain_shape("ring", lambda r: shapes.annulus(r.uniform(0.45, 0.6)), upright=False),
        _plain_shape("oval", lambda r: shapes.oval(r.uniform(1.6, 1.9))),
        _plain_shape("arrow", lambda r: shapes.arrow(r.uniform(0.5, 0.7))),
        _plain_shape("heart", lambda r: shapes.heart()),
        _plain_shape("crescent", lambda r: shapes.crescent(r.uniform(0.3, 0.45))),
        _plain_shape("frame", lambda r: shapes.frame(r.uniform(1, 1.3), 0.17), 4),
        _plain_shape("hoop", _hoop, upright=False, encloses=True),
    ),
    ground.sheet,
    turns="either",
    rows=0.3,
    beyond=(),
)
LOOSELY = {
    "car": {"van"},
    "boat": {"motorboat"},
    "buoy": {"lifebuoy"},
    "tank": {"barrel"},
    "bush": {"hedge"},
    "circle": {"ring", "oval", "hoop", "hexagon"},
    "oval": {"circle"},
    "ring": {"circle", "hoop", "C shape"},
    "hoop": {"circle", "ring"},
    "square": {"rectangle", "frame"},
    "rectangle": {"square", "frame"},
    "frame": {"square", "rectangle"},
    "pentagon": {"hexagon"},
    "hexagon": {"pentagon", "circle"},
    "crescent": {"C shape"},
    "C shape": {"crescent", "ring"},
}
"""Other things that some would call by a noun."""
FAMILIES = (PARKING, TABLE, WAREHOUSE, GARDEN, HARBOUR, SHAPES)
