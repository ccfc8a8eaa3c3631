"""What is known of the world: one picture, the targets found in it, and where robots are.

A Scene is an immutable value; its version is a hash of all that a certificate depends on.
Frame everywhere: pixels of the picture as the user sees it, x right, y down.
"""

from dataclasses import dataclass, replace

import shapely

from .errors import ToolError
from .formation.contract import Contract
from .formation.placement.place import Site
from .formation.plan import scene_version
from .formation.units import check_scale
from .geometry.outline import Outline
from .perception.image import Picture
from .perception.target_prompt import TargetPrompt

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Target:
    """An object of interest.

    Attributes:
        id: t1, t2, ... in order of finding.
        label: what it is called; "the thing pointed at" where nobody named it.
        box: x0, y0, x1, y1.
        confidence: alpha, 0 to 1: self-consistency of the segmentation, not accuracy.
        outline: measured, holes kept.
        prompt: what it was found from: point, box, outline or points.
        parts: what alpha was made of.
        source: what it was found from, if that was an outline somebody drew.
        missed: vertices of the rough outline it was found from that lie well outside of `outline`.
    """

    id: str
    label: str
    box: Box
    confidence: float
    outline: Outline
    prompt: str
    parts: tuple[tuple[str, float], ...] = ()
    missed: tuple[tuple[float, float], ...] = ()
    source: TargetPrompt | None = None


@dataclass(frozen=True)
class Scene:
    """A picture and the targets found in it.

    Attributes:
        metres_per_pixel: the same everywhere, as in a picture taken straight from above; None
            where it is not known.

    Raises:
        InputError: metres per pixel that no picture has.
    """

    picture: Picture
    targets: tuple[Target, ...] = ()
    metres_per_pixel: float | None = None

    def __post_init__(self) -> None:
        check_scale(self.metres_per_pixel)

    @property
    def version(self) -> str:
        """Changes with the picture, its scale and every target found, moved or renamed."""
        outlines = {t.id: _canonical(t.outline) for t in self.targets}
        return scene_version(self.picture.sha256, outlines, self.metres_per_pixel)

    def target(self, name: str) -> Target:
        """The target with an id.

        Raises:
            ToolError: there is none; the text lists those there are.
        """
        for target in self.targets:
            if target.id == name:
                return target
        known = ", ".join(t.id for t in self.targets) or "none yet: segment something first"
        raise ToolError(f"There is no target {name!r}. Targets: {known}.", "unknown_target")

    def with_target(self, target: Target) -> "Scene":
        """The scene with one more target, or with the one of the same id replaced."""
        others = tuple(t for t in self.targets if t.id != target.id)
        return replace(self, targets=(*others, target))

    def site(self, contract: Contract) -> Site:
        """The outlines a contract refers to and the picture's size.

        Raises:
            ToolError: it names a target that is not there.
        """
        outlines = {name: self.target(name).outline for name in contract.target_ids}
        return Site(outlines, *self.picture.size, self.metres_per_pixel)


def _canonical(outline: Outline) -> str:
    """The region as text that does not depend on where its rings start or how they are ordered."""
    return shapely.to_wkt(shapely.normalize(outline.polygon), rounding_precision=6)
