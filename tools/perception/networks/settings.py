"""Settings of networks that belong to a machine, not to an instruction: environment variables."""

import os

from ...errors import InputError

DEVICE, DTYPE, SCORE = "FORMUP_DEVICE", "FORMUP_DTYPE", "FORMUP_DETECTION_THRESHOLD"
DTYPES = ("float32", "float16", "bfloat16")


def device_name(usual: str) -> str:
    """Return torch's name of the device to run networks on: the one set, or the usual one."""
    return os.environ.get(DEVICE) or usual


def dtype_name() -> str:
    """Return the name of the data type that networks compute in.

    Raises:
        InputError: FORMUP_DTYPE is none of DTYPES.
    """
    chosen = os.environ.get(DTYPE) or DTYPES[0]
    if chosen not in DTYPES:
        raise InputError(f"{DTYPE}={chosen!r} is none of {', '.join(DTYPES)}.")
    return chosen


def detection_threshold(usual: float) -> float:
    """Return the least score of things found by words: the one set, or the usual one.

    Raises:
        InputError: FORMUP_DETECTION_THRESHOLD is no score.
    """
    setting = os.environ.get(SCORE)
    try:
        value = float(setting) if setting else usual
    except ValueError:
        value = -1.0
    if not 0 <= value < 1:
        raise InputError(f"{SCORE}={setting!r} is no score: give a number from 0 up to 1.")
    return value
