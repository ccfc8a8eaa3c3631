"""What the readers of mask files return, and the errors they share."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...geometry.outline import FARTHEST, FloatArray

Size = tuple[int, int]
"""Width and height, px."""
Pixels = Callable[[], NDArray[np.bool_]]
"""Makes a mask (H, W) on demand: of a hundred in a large picture, one is in memory at a time."""


class Shape(NamedTuple):
    """A thing as a file describes it.

    Attributes:
        label: what the file calls it; often empty.
        pixels: makes its mask, if the file gives its pixels.
        rings: its parts otherwise, rings (n, 2), px, x right, y down, from the picture's upper left
            corner; each part is a sequence of its outer ring and its holes.
    """

    label: str
    pixels: Pixels | None = None
    rings: Sequence[Sequence[FloatArray]] = ()


def refusal(what: str, remedy: str) -> InputError:
    """Return the error that says what is wrong with a file and what to do.

    The caller prepends the file's name.
    """
    return InputError(f"{what}; {remedy}.")


def ring_of(points: Any) -> FloatArray:
    """Return the points (n, 2) that a list of numbers or pairs holds.

    Raises:
        InputError: it holds something else, fewer than three points, or numbers out of range.
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
    """Compare the picture size that a file states, if it does, with the picture's.

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
    """Return the fields of a JSON object; none if the value is not an object."""
    return cast("Mapping[str, Any]", value) if isinstance(value, dict) else {}


def items(value: Any) -> list[Any]:
    """Return the items of a JSON list; none if the value is not a list."""
    return cast("list[Any]", value) if isinstance(value, list) else []
