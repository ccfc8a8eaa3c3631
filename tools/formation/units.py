"""Conversion between metres and pixels of a picture taken straight from above.

All computation is in pixels. A scale that varies over the picture would be handled here.
"""

import math
from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from ..errors import InputError, ToolError
from .contract import MAX_LENGTH, Contract, Group, Unit, broken_rules

FINEST, COARSEST = 1e-6, 1e3
"""Least and greatest metres per pixel: from a microscope's picture to a satellite's."""
NO_SCALE = "this picture has no scale (metres per pixel)"
DECIMALS_PX, STATED_PX = 2, 6
"""Decimals of a pixel: DECIMALS_PX that lengths in metres resolve, STATED_PX that a contract's
lengths are rounded to."""
LENGTHS = ("min_spacing", "max_gap", "pitch", "radius", "opening")
"""Fields of a group that are a single length."""


def check_scale(metres_per_pixel: float | None) -> None:
    """Check a picture's scale, which may be None.

    Raises:
        InputError: it is not a number from 0.000001 to 1000.
    """
    if metres_per_pixel is not None and not FINEST <= metres_per_pixel <= COARSEST:  # nan fails
        raise InputError(
            f"{metres_per_pixel:g} metres per pixel cannot be the scale of a picture; give a "
            "number from 0.000001 to 1000, such as 0.05."
        )


def in_pixels(length: float, unit: Unit | None, metres_per_pixel: float | None) -> float:
    """Convert a length to pixels; metres give at most 100,000 px, rounded to 6 decimals.

    Args:
        length: the length, in `unit`.
        unit: None means px if there is no scale; if there is one, a unit is required.
        metres_per_pixel: None if the picture has no scale.

    Raises:
        ToolError: metres are given without a scale, or no unit with one.
    """
    if unit == "m" and metres_per_pixel is None:
        raise ToolError(
            f"Lengths in m cannot be used: {NO_SCALE}. Give them in px, or ask the person."
        )
    if unit is None and metres_per_pixel is not None:
        raise ToolError('The picture has a scale: say the lengths\' unit, "m" or "px".')
    if unit == "m" and metres_per_pixel is not None:
        return min(round(length / metres_per_pixel, STATED_PX), MAX_LENGTH)
    return length


def contract_in_pixels(contract: Contract, metres_per_pixel: float | None) -> Contract:
    """Return the contract with all lengths in pixels, whatever unit they were stated in.

    Args:
        contract: the contract as stated; a length of 0 needs no unit.
        metres_per_pixel: the picture's scale; None if it has none.

    Raises:
        ToolError: metres are given without a scale, lengths without a unit although there is one,
            or lengths are too small or large at this scale.
    """

    def px(length: float) -> float:
        return in_pixels(length, contract.unit, metres_per_pixel) if length else length

    def group_in_px(group: Group) -> Group:
        given = {name: getattr(group, name) for name in LENGTHS}
        update: dict[str, Any] = {k: px(v) for k, v in given.items() if v is not None}
        if group.clearance is not None:
            update["clearance"] = tuple(map(px, group.clearance))
        return group.model_copy(update=update)

    update = {
        "groups": tuple(map(group_in_px, contract.groups)),
        "robot_radius": px(contract.robot_radius),
        "keep_out_clearance": px(contract.keep_out_clearance),
        "unit": None if metres_per_pixel is None else "px",
    }
    converted = contract.model_copy(update=update)
    if contract.unit != "m":
        return converted
    try:
        return Contract.model_validate(converted.model_dump())
    except ValidationError as error:
        found = broken_rules(error)
        raise ToolError(f"The lengths cannot be used at this scale: {found} (in px).") from None


def in_metres(pixels: float, metres_per_pixel: float) -> float:
    """Convert a length or coordinate to metres, rounded to 0.01 px or slightly finer."""
    return round(pixels * metres_per_pixel, _decimals(DECIMALS_PX, metres_per_pixel))


def length_text(
    px: float | tuple[float, float],
    metres_per_pixel: float | None,
    spec: str = ".1f",
    joint: str = " to ",
) -> str:
    """Format a length, or two of them joined, as all texts show it.

    Args:
        px: one or two lengths, px.
        metres_per_pixel: if known, metres come first: "1.25 m (25.0 px)".
        spec: format of the pixels; metres get enough decimals for the same resolution.
        joint: text between two lengths.
    """
    numbers = [format(length, spec) for length in (px if isinstance(px, tuple) else (px,))]
    text = f"{joint.join(numbers)} px"
    if metres_per_pixel is None:
        return text

    def metres(number: str) -> str:
        decimals = _decimals(len(number.partition(".")[2]), metres_per_pixel)
        return f"{float(number) * metres_per_pixel:,.{decimals}f}"

    return f"{joint.join(map(metres, numbers))} m ({text})"


def with_metres(data: Mapping[str, Any], metres_per_pixel: float | None) -> dict[str, Any]:
    """Return the data with each number in px, such as `far_px`, also in metres, as `far_m`.

    `area_px` is accompanied by `area_m2`.
    """
    if metres_per_pixel is None:
        return dict(data)
    beside: dict[str, Any] = {}
    for name, value in data.items():
        beside[name] = value
        if name == "area_px":
            area = in_metres(value * metres_per_pixel, metres_per_pixel)
            beside["area_m2"] = area
        elif name.endswith("_px") and isinstance(value, int | float):
            beside[f"{name.removesuffix('_px')}_m"] = in_metres(value, metres_per_pixel)
    return beside


def _decimals(px_decimals: int, metres_per_pixel: float) -> int:
    """Return how many decimals of metres resolve at least what `px_decimals` of pixels do."""
    return max(0, math.ceil(px_decimals - math.log10(metres_per_pixel)))
