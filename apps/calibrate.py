"""`formup calibrate`: find out, once, where on the floor the pixels of a camera are."""

from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from ..tools.errors import InputError
from ..tools.perception.cameras.fitting import calibrated
from ..tools.perception.cameras.known import Known, KnownPoint, read_known
from ..tools.perception.image import picture_file
from ..tools.store import write_whole
from . import options as o
from .given import picture_given
from .terminal import say

Points = Annotated[
    list[str] | None,
    typer.Option(
        "--point", help="PX,PY=X,Y: a pixel, and its position on the floor in metres; repeatable."
    ),
]
KnownFile = Annotated[
    Path | None,
    typer.Option(
        "--known", help="YAML file with known points, tags or a board on the floor, and the lens."
    ),
]
Out = Annotated[Path, typer.Option("--out", help="File to write, such as camera.yaml.")]


def calibrate(
    ctx: typer.Context,
    out: Out,
    image: Annotated[
        Path | None, typer.Argument(help="Picture of the floor; omit with --camera.")
    ] = None,
    camera: o.Camera = None,
    point: Points = None,
    known: KnownFile = None,
) -> None:
    """Find where on the floor a camera's pixels lie, for --calibration.

    Writes the calibration file and, beside it, the picture rectified to a top view of the floor.
    """
    if (known is None) == (not point):
        raise InputError(
            "Give what is known of the floor, either --known FILE or at least four --point."
        )
    given = Known(points=tuple(map(_clicked, point or ()))) if known is None else read_known(known)
    picture = picture_given(ctx.params)
    if picture is None:
        raise InputError("Give a picture of the floor, or --camera.")
    found = calibrated(given, picture.pixels, known or Path("--point"))
    top, seen = found.top_view(picture, out.name), out.with_suffix(".png")
    write_whole(out, found.to_yaml().encode())
    write_whole(seen, picture_file(top))
    off, (x0, y0, x1, y1) = found.residuals, found.floor
    say(f"floor       x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m, all of it in the picture")
    say(f"top view    {top.width} x {top.height} px at {found.metres_per_pixel:g} m: {seen}")
    say(f"residuals   mean {off.mean_px:.2f} px, {off.mean_mm:.1f} mm")
    say(f"            worst {off.worst_px:.2f} px, {off.worst_mm:.1f} mm")
    say(f"corners     of the floor off by up to {off.corners_mm:.1f} mm, if pixels are by as much")
    if found.camera is not None:
        x, y, height = found.camera
        say(f"camera      above x {x:.2f} m, y {y:.2f} m, at a height of {height:.2f} m")
    if len(given.points) == 4:
        say("note        four points always fit exactly; a fifth would reveal a wrong one")
    say(f"written     {out}")


def _clicked(text: str) -> KnownPoint:
    pixel, _, floor = text.partition("=")
    try:
        return KnownPoint.model_validate({"pixel": pixel.split(","), "floor": floor.split(",")})
    except ValidationError:
        raise InputError(
            f"--point {text!r} cannot be read; give PX,PY=X,Y, such as 640,360=2,1.5: a pixel, and "
            "metres on the floor."
        ) from None
