"""Where positions are judged: the targets' outlines and the picture; what does not fit there."""

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
"""What was found with at least this confidence is a thing."""
WITHIN, ROOMY = 0.8, 0.7
"""What is meant lies in a hole if more than WITHIN of it does, and has room there if it covers less
than ROOMY of the hole; else the thing with the hole is what it lies on."""
BLUR = 0.2
"""How far off the outline of a thing of no confidence may be, as a share of its size."""


@dataclass(frozen=True)
class Other:
    """A thing in the picture that a contract does not name: robots keep off it where they can.

    Its region is in px, holes and all, its confidence from 0 to 1.
    """

    id: str
    label: str
    region: Polygon
    confidence: float = 1.0

    @property
    def sure(self) -> bool:
        """Whether it was found with confidence; else it may be no thing at all."""
        return self.confidence >= SURE

    @property
    def blur(self) -> float:
        """How far off its outline may be, px."""
        return BLUR * (1 - self.confidence) * math.sqrt(self.region.area)


def closed(region: Polygon, meant: Iterable[Outline]) -> Polygon:
    """A region with its holes filled, but those in which something that is meant lies with room."""
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

    With metres per pixel, texts about positions give lengths in metres too. A certificate does not
    depend on the others.
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
        """A length in px as texts show it, see `length_text`."""
        return length_text(px, self.metres_per_pixel, spec, joint)

    def visible(self, name: str) -> Outline:
        """The part of a target inside the picture.

        Raises:
            ToolError: there is none.
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
        """What of a target robots keep off: its holes too, where no other target lies in them."""
        others = [self.outlines[other] for other in contract.target_ids if other != name]
        return closed(self.outlines[name].polygon, others)

    def frame(self, radius: float) -> Frame:
        """Where robots of a radius stand wholly inside the picture."""
        return Frame(self.width, self.height, radius)


MORE = 32
"""Numbers tried above the estimate of how many robots fit."""


def most_that_fit(fits: Callable[[int], bool], estimate: int, too_many: int) -> int:
    """The greatest number of robots found that fit, a little above an estimate or below it.

    Fewer robots do not always fit where more do: corners and tips that they take first may be
    nearer to each other than the places that more of them share.
    """
    tried = range(min(too_many - 1, estimate + MORE), 0, -1)
    return next((n for n in tried if fits(n)), 0)


class PlacementError(ToolError):
    """The robots of a contract cannot all be placed; fewer, or nearer, may be."""


class CapacityError(PlacementError):
    """A group has more robots than its place holds."""

    def __init__(self, group: Group, fits: int, why: str) -> None:
        noun = "robot fits" if fits == 1 else "robots fit"
        asked = "1 robot was" if group.robots == 1 else f"{group.robots} robots were"
        text = f"{asked} asked for but only {fits} {noun}: {why}."
        super().__init__(text, "capacity", robots_that_fit=fits)
        self.fits = fits
        self.group = group
