"""What a command line gives to work on: the picture of a file or a camera, and what is fixed."""

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
    """The picture and the instruction; with --camera the only word is the instruction.

    Raises:
        InputError: as of `picture_given`, or one of them is missing.
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
    """The picture of a file or a camera, as seen straight from above where there is a calibration.

    Args:
        options: of the command line by their names: `image`, `camera`, perhaps `calibration` and
            `metres_per_pixel`.

    Raises:
        InputError: it cannot be had, or is said twice, or there is none to rectify.
    """
    image, camera, file = options["image"], options["camera"], options.get("calibration")
    if image is not None and camera is not None:
        raise InputError(f"--camera takes the picture; leave out {str(image)!r}, or the camera.")
    if file is not None and options["metres_per_pixel"] is not None:
        raise InputError("--calibration says the scale; leave out --metres-per-pixel.")
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
    """What the person fixed.

    Args:
        options: of the command line by their names.
        picture: whose file may say its scale.

    Raises:
        InputError: one of them cannot be used.
    """
    texts = ("robots", "metres_per_pixel", "robot_radius", "clearance", "threshold", "seed")
    fixed = arguments.numbers(*(options[name] for name in texts), picture=picture)
    file = options["starts"]
    fixed |= {name: options[name] for name in ("detector", "segmenter", "fleet", "numbered")}
    fixed["starts"] = starts(None if file is None else Path(file))
    shape = arguments.descriptor(options["descriptor"])
    return Settings(**fixed, descriptor=shape, may_deploy=may_deploy)
