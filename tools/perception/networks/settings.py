"""Settings of networks that are a machine's rather than an instruction's: from the environment."""

import os

from ...errors import InputError

DEVICE, DTYPE, SCORE = "FORMUP_DEVICE", "FORMUP_DTYPE", "FORMUP_DETECTION_THRESHOLD"
DTYPES = ("float32", "float16", "bfloat16")


def device_name(usual: str) -> str:
    """The device that networks run on, as torch calls it."""
    return os.environ.get(DEVICE) or usual


def dtype_name() -> str:
    """How exactly networks compute.

    Raises:
        InputError: FORMUP_DTYPE is none of DTYPES.
    """
    chosen = os.environ.get(DTYPE) or DTYPES[0]
    if chosen not in DTYPES:
        raise InputError(f"{DTYPE}={chosen!r} is none of {', '.join(DTYPES)}.")
    return chosen


def detection_threshold(usual: float) -> float:
    """The least score of what is found by words.

    Raises:
        InputError: FORMUP_DETECTION_THRESHOLD is no score.
    """
    said = os.environ.get(SCORE)
    try:
        value = float(said) if said else usual
    except ValueError:
        value = -1.0
    if not 0 <= value < 1:
        raise InputError(f"{SCORE}={said!r} is no score: give a number from 0 up to 1.")
    return value
