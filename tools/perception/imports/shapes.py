"""What the readers of mask files find, and the errors they have in common."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...geometry.outline import FARTHEST, FloatArray

Size = tuple[int, int]
"""Width and height, px."""
Pixels = Callable[[], NDArray[np.bool_]]
"""Makes a mask, (H, W): of a hundred things in a large picture only one is held at a time."""


class Shape(NamedTuple):
    """A thing as a file has it.

    Attributes:
        label: what the file calls it; often nothing.
        pixels: where the file says which pixels are the thing's.
        rings: else its parts, (n, 2) each, px, x right, y down, from the picture's upper left
            corner; the holes of a part follow it in its tuple.
    """

    label: str
    pixels: Pixels | None = None
    rings: Sequence[Sequence[FloatArray]] = ()


def refusal(what: str, remedy: str) -> InputError:
    """What is wrong with a file, for who names it to begin with its name, and what to do."""
    return InputError(f"{what}; {remedy}.")


def ring_of(points: Any) -> FloatArray:
    """The (n, 2) places that a list of numbers or pairs holds.

    Raises:
        InputError: it holds something else, or fewer than three.
    """
    try:
        ring = np.asarray(points, dtype=float).reshape(-1, 2)
    except (TypeError, ValueError, OverflowError):
        raise refusal("a polygon in it is no list of x, y", "export it again") from None
    if len(ring) < 3 or not (np.abs(ring) <= FARTHEST * 100).all():  # NaN fails
        raise refusal(
            "a polygon in it has fewer than 3 vertices, or numbers that are no place",
            "export it again",
        )
    return ring


def check_size(given: Any, size: Size) -> None:
    """Hold the size that a file says its picture has against the picture's; nothing is any.

    Raises:
        InputError: they differ.
    """
    if any(v is None for v in given) or tuple(given) == size:
        return
    turned = ", with rows before columns" if tuple(given)[::-1] == size else ""
    made = " x ".join(str(v)[:20] for v in given)
    raise refusal(
        f"it is for a picture of {made} px{turned}, and this one has {size[0]} x {size[1]} px",
        "give the mask of the picture as it is shown, width before height",
    )


def fields(value: Any) -> Mapping[str, Any]:
    """A JSON object; nothing of what is none."""
    return cast("Mapping[str, Any]", value) if isinstance(value, dict) else {}


def items(value: Any) -> list[Any]:
    """A JSON list; nothing of what is none."""
    return cast("list[Any]", value) if isinstance(value, list) else []
