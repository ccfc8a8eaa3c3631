"""Check that annotations fit their picture, in its frame: px as it is shown, x right, y down.

Outlines in another frame are refused, and the error names the frame that would fit.
"""

from pathlib import Path
from typing import Any

import numpy as np
from shapely.geometry import Polygon

from ...tools.errors import InputError
from ...tools.perception.image import load_picture
from ...tools.perception.imports.frames import BETTER, is_seen, likeliest_frame


def check_frame(entry: dict[str, Any], folder: Path) -> None:
    """Check an entry of annotations against its picture.

    Raises:
        InputError: another picture or size, an outline that crosses itself, or another frame.
    """
    name, things = entry["image"], entry["objects"]
    picture = load_picture(folder / name)
    if entry.get("sha256", picture.sha256) != picture.sha256:
        raise InputError(f"{name} is another picture than the annotated one: its sha256 differs.")
    if (annotated := (entry["width"], entry["height"])) != picture.size:
        raise InputError(
            f"{name} is annotated as {annotated[0]} x {annotated[1]} px, but is shown with "
            f"{picture.width} x {picture.height} px (EXIF orientation applied); annotate that."
        )
    rings = [np.asarray(thing["polygon"], dtype=float) for thing in things]
    for thing, ring in zip(things, rings, strict=True):
        if not all(Polygon(r).is_valid for r in (ring, *thing.get("holes", ()))):
            raise InputError(
                f"The outline of {thing['id']} in {name} crosses itself; give its points in order "
                "around the thing."
            )
    size = np.asarray(picture.size, dtype=float)
    best, better = likeliest_frame(picture, rings)
    fits = better > BETTER
    regions = [(thing["id"], Polygon(ring)) for thing, ring in zip(things, rings, strict=True)]
    outside = [name for name, region in regions if not is_seen(region, size)]
    if outside or fits:
        what = f"of {', '.join(outside)} lie outside" if outside else "do not follow things in"
        raise InputError(
            f"Outlines {what} {name}, {picture.width} x {picture.height} px"
            f"{f'; they would fit {best}' if fits else ''}. Give x, y in px as it is shown."
        )
