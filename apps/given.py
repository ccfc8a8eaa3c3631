"""The inputs of a command line: a picture from a file or a camera, and the settings."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..tools.context import Settings
from ..tools.errors import InputError
from ..tools.perception.cameras.calibration import read_calibration
from ..tools.perception.cameras.reader import picture_taken
from ..tools.perception.image import Picture, load_picture
from . import arguments
from .starts import starts


def picture_and_words(options: Mapping[str, Any]) -> tuple[Picture, str]:
    """Return the picture and the instruction; with --camera, a lone argument is the instruction.

    Raises:
        InputError: as for `picture_given`, or one of them is missing.
    """
    words = options["instruction"]
    if options["camera"] is not None and words is None:
        words, options = options["image"], {**options, "image": None}
    picture = picture_given(options)
    if picture is None or words is None:
        raise InputError(
            "Missing argument 'INSTRUCTION'; give IMAGE and INSTRUCTION, or with --camera the "
            "INSTRUCTION alone."
        )
    return picture, words


def picture_given(options: Mapping[str, Any]) -> Picture | None:
    """Return the picture from a file or a camera, rectified to a top view by any calibration.

    Args:
        options: the command line's options by name: `image`, `camera`, perhaps `calibration` and
            `metres_per_pixel`.

    Returns:
        The picture; None if neither a file nor a camera is given.

    Raises:
        InputError: the picture cannot be read or taken, the picture or the scale is given twice,
            or there is a calibration without a picture.
    """
    image, camera, file = options["image"], options["camera"], options.get("calibration")
    if image is not None and camera is not None:
        raise InputError(f"Both {str(image)!r} and --camera give a picture; leave out one of them.")
    if file is not None and options["metres_per_pixel"] is not None:
        raise InputError("--calibration already sets the scale; leave out --metres-per-pixel.")
    calibration = None if file is None else read_calibration(Path(file))
    if image is None and camera is None:
        if calibration is not None:
            raise InputError("--calibration needs a picture; give IMAGE or --camera.")
        return None
    picture = picture_taken(str(camera)) if image is None else load_picture(image)
    return picture if calibration is None else calibration.top_view(picture, str(file))


def settings_given(
    options: Mapping[str, Any], picture: Picture | None, *, may_deploy: bool = True
) -> Settings:
    """Return the settings that the options fix.

    Args:
        options: the command line's options by name.
        picture: its file may state its scale.

    Raises:
        InputError: one of the options cannot be used.
    """
    texts = ("robots", "metres_per_pixel", "robot_radius", "clearance", "threshold", "seed")
    fixed = arguments.numbers(*(options[name] for name in texts), picture=picture)
    file = options["starts"]
    fixed |= {name: options[name] for name in ("detector", "segmenter", "fleet", "numbered")}
    fixed["starts"] = starts(None if file is None else Path(file))
    shape = arguments.descriptor(options["descriptor"])
    return Settings(**fixed, descriptor=shape, may_deploy=may_deploy)
