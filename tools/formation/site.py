"""The site that positions are judged in, outlines and picture, and errors for what does not fit."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import shapely
from shapely.geometry import Polygon

from ..errors import ToolError
from ..geometry.curves import Frame
from ..geometry.outline import MIN_AREA, Outline, largest_part, outline_of
from .contract import Contract, Group
from .units import length_text

SURE = 0.55
"""An object found with at least this confidence counts as certain."""
WITHIN, ROOMY = 0.8, 0.7
"""An outline lies in a hole if more than WITHIN of its area does, and has room there if its area is
less than ROOMY of the hole's; otherwise it lies on the object that has the hole."""
BLUR = 0.2
"""Error of the outline of an object found with confidence 0, as a share of its size."""


@dataclass(frozen=True)
class Other:
    """An object in the picture that a contract does not name; robots keep off it if they can.

    Its region is in px and includes holes; its confidence is from 0 to 1.
    """

    id: str
    label: str
    region: Polygon
    confidence: float = 1.0

    @property
    def sure(self) -> bool:
        """Whether it was found with confidence; otherwise there may be no object at all."""
        return self.confidence >= SURE

    @property
    def blur(self) -> float:
        """The possible error of its outline, px."""
        return BLUR * (1 - self.confidence) * math.sqrt(self.region.area)


def closed(region: Polygon, meant: Iterable[Outline]) -> Polygon:
    """Fill a region's holes, except those in which an outline of `meant` lies with room."""
    solid = [outline.filled for outline in meant] if region.interiors else []
    holes = [Polygon(ring) for ring in region.interiors]
    open_ = [h for h in holes if any(_holds(h, r) for r in solid)]
    return Polygon(region.exterior, [h.exterior for h in open_])


def _holds(hole: Polygon, region: Polygon) -> bool:
    within = region.intersection(hole).area > WITHIN * region.area
    return bool(within and region.area < ROOMY * hole.area)


@dataclass(frozen=True)
class Site:
    """What positions are judged in: the targets' outlines and the picture's size, px.

    With metres per pixel, texts about positions give lengths in metres too. Certificates do not
    depend on `others`.
    """

    outlines: Mapping[str, Outline]
    width: float
    height: float
    metres_per_pixel: float | None = None
    others: tuple[Other, ...] = ()

    @property
    def room(self) -> tuple[float, float]:
        """Width and height, px."""
        return self.width, self.height

    def length(
        self, px: float | tuple[float, float], spec: str = ".1f", joint: str = " to "
    ) -> str:
        """Format lengths in px as texts show them, see `length_text`."""
        return length_text(px, self.metres_per_pixel, spec, joint)

    def visible(self, name: str) -> Outline:
        """Return the part of a target inside the picture.

        Raises:
            ToolError: it lies outside the picture.
        """
        outline = self.outlines[name]
        picture = shapely.box(-0.5, -0.5, self.width - 0.5, self.height - 0.5)  # whole pixels
        if picture.covers(outline.polygon):
            return outline
        seen = largest_part(outline.polygon.intersection(picture))
        if seen is None or seen.area < MIN_AREA:
            raise ToolError(f"{name} lies outside the picture.")
        return outline_of(seen)

    def solid(self, name: str, contract: Contract) -> Polygon:
        """Return the part of a target that robots keep off, and of a keep-out what is too near.

        This includes its holes, except those in which another target lies with room.
        """
        others = [self.outlines[other] for other in contract.target_ids if other != name]
        region = closed(self.outlines[name].polygon, others)
        kept = contract.keep_out_clearance if name in contract.keep_out else 0.0
        return region.buffer(kept) if kept else region

    def frame(self, radius: float) -> Frame:
        """Return the frame in which robots of a radius, px, stand wholly inside the picture."""
        return Frame(self.width, self.height, radius)


MORE = 32
"""How far above the estimate of how many robots fit the search begins."""


def most_that_fit(fits: Callable[[int], bool], estimate: int, too_many: int) -> int:
    """Return the greatest number of robots found to fit, from slightly above an estimate downwards.

    Returns 0 if none fit; `too_many` is known not to fit. Fewer robots do not always fit where more
    do: the corners and tips that they take first may be nearer to each other than the places that
    more robots share.
    """
    tried = range(min(too_many - 1, estimate + MORE), 0, -1)
    return next((n for n in tried if fits(n)), 0)


class PlacementError(ToolError):
    """Not all robots of a contract can be placed; fewer, or a nearer clearance, may be possible."""


class CapacityError(PlacementError):
    """A group has more robots than fit; `fits` is how many do."""

    def __init__(self, group: Group, fits: int, why: str) -> None:
        noun = "robot fits" if fits == 1 else "robots fit"
        asked = "1 robot was" if group.robots == 1 else f"{group.robots} robots were"
        text = f"{asked} asked for but only {fits} {noun}: {why}."
        super().__init__(text, "capacity", robots_that_fit=fits)
        self.fits = fits
        self.group = group
