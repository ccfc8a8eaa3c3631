"""Metres and pixels: one becomes the other exactly, and texts tell both."""

import math
from typing import Any

import pytest
from formup.tools.errors import InputError, ToolError
from formup.tools.formation.contract import Contract
from formup.tools.formation.plan import make_plan
from formup.tools.formation.site import Site
from formup.tools.formation.units import (
    check_scale,
    contract_in_pixels,
    in_metres,
    in_pixels,
    length_text,
    with_metres,
)
from formup.tools.geometry.outline import make_outline
from hypothesis import given, settings
from hypothesis import strategies as st

SCALES = st.floats(1e-4, 20).map(lambda v: float(f"{v:.4g}"))
BOX = make_outline([(120, 100), (260, 100), (260, 190), (120, 190)])


def contract(unit: str | None, radius: float, **group: Any) -> Contract:
    one = {"relation": "around", "targets": ["t1"], "robots": 8} | group
    return Contract.model_validate({"groups": [one], "robot_radius": radius, "unit": unit})


@given(SCALES, st.floats(0.01, 5_000), st.floats(0.1, 10))
def test_a_scale_so_many_times_makes_metres_so_many_times(
    scale: float, px: float, times: float
) -> None:
    assert in_metres(px, scale * times) == pytest.approx(
        in_metres(px, scale) * times, abs=scale * times * 0.02
    )
    assert in_pixels(px * scale, "m", scale) == pytest.approx(px, abs=1e-6)
    assert in_pixels(px * scale * times, "m", scale * times) == pytest.approx(px, abs=1e-6)


MILS = st.integers(4_000, 40_000).map(lambda v: v / 1000)


@settings(deadline=None, max_examples=20)
@given(st.floats(0.01, 3).map(lambda v: round(v, 4)), MILS, MILS, MILS)
def test_a_contract_in_metres_certifies_exactly_what_its_pixels_do(
    scale: float, clearance: float, radius: float, spacing: float
) -> None:
    def made(unit: str, factor: float) -> Contract:
        least, apart, size = (v * factor for v in (clearance, spacing, radius / 8))
        stated = contract(unit, size, clearance=[least, 2 * least], min_spacing=apart / 2)
        return contract_in_pixels(stated, scale)

    site = Site({"t1": BOX}, 400, 300, scale)
    metric, plain = (make_plan(made(*how), site, "s") for how in (("m", scale), ("px", 1.0)))
    assert metric == plain
    assert metric.id == plain.id
    assert metric.formation.contract.unit == "px"


def test_a_unit_is_asked_for_where_there_is_a_scale_and_metres_are_not_where_there_is_none() -> (
    None
):
    open_lengths = contract(None, 0)
    assert contract_in_pixels(open_lengths, 0.05).unit == "px"
    assert contract_in_pixels(open_lengths, None) == open_lengths
    stated = contract("px", 3.3, clearance=[1 / 3, 2 / 3])
    assert contract_in_pixels(stated, None) == stated.model_copy(update={"unit": None})
    with pytest.raises(ToolError, match='"m" or "px"'):
        contract_in_pixels(contract(None, 2), 0.05)
    with pytest.raises(ToolError, match=r"no scale.*px, or ask the person"):
        contract_in_pixels(contract("m", 0, clearance=[1, 2]), None)


def test_a_contract_is_written_with_its_unit() -> None:
    assert contract(None, 0).model_dump()["unit"] is None
    assert contract("m", 0).model_dump()["unit"] == "m"


@pytest.mark.parametrize("scale", [0, -1, math.nan, math.inf, 1e-9, 1e9])
def test_scales_that_no_picture_has(scale: float) -> None:
    with pytest.raises(InputError, match=r"0\.000001 to 1000"):
        check_scale(scale)


@pytest.mark.parametrize(
    ("px", "form", "plain", "metric"),
    [
        (2.5, {}, "2.5 px", "0.125 m (2.5 px)"),
        ((25, 100), {}, "25.0 to 100.0 px", "1.250 to 5.000 m (25.0 to 100.0 px)"),
        ((30, 20), {"spec": "g", "joint": " x "}, "30 x 20 px", "1.50 x 1.00 m (30 x 20 px)"),
        (-0.5, {}, "-0.5 px", "-0.025 m (-0.5 px)"),
        (31200, {"spec": ".0f"}, "31200 px", "1,560.00 m (31200 px)"),
    ],
)  # fmt: skip
def test_texts_give_metres_with_the_pixels_behind_them(
    px: float | tuple[float, float], form: dict[str, str], plain: str, metric: str
) -> None:
    assert length_text(px, None, **form) == plain
    assert length_text(px, 0.05, **form) == metric


def test_numbers_named_in_px_have_metres_beside_them() -> None:
    data = {"far_px": 30.0, "area_px": 400, "escape_proof": "certified", "ratio": 0.5}
    told = with_metres(data, 0.05)
    assert told == data | {"far_m": 1.5, "area_m2": 1.0}
    assert with_metres(data, None) == data
