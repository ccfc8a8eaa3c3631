"""What is pointed at: outlines that cross themselves, and masks, which no model is asked for."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import Mask, TargetPrompt
from pydantic import ValidationError

if TYPE_CHECKING:
    from ..conftest import ToolCalls

Begin = Callable[..., "ToolCalls"]
SQUARE = ((60.0, 40.0), (120.0, 40.0), (120.0, 90.0), (60.0, 90.0))
SWAPPED = (SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3])


def scene() -> Picture:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    return picture_from_array(pixels)


def test_a_drawn_outline_is_mended_measured_and_that_is_said(tool_calls: Begin) -> None:
    calls = tool_calls(scene())
    reply = calls.call("segment", outline=SWAPPED)
    assert "two vertices changed places" in reply.data["note"]
    assert calls.world.targets[0].outline.area == pytest.approx(3000, rel=0.05)


def test_a_mask_stays_what_the_person_gave_whatever_a_model_points_with(tool_calls: Begin) -> None:
    given = TargetPrompt(label="crate", mask=Mask(rings=(SQUARE,), found_in="that of a.png"))
    calls = tool_calls(scene())
    calls.keep(calls.world.having(pointed=(given,)))
    assert given.brief == {"id": "t1", "label": "crate", "box": (60, 40, 120, 90)}
    for _ in range(2):
        calls.call("segment", id="t1", box=[10, 10, 190, 130])
        target = calls.world.target("t1")
        assert (target.prompt, target.confidence) == ("mask", 1.0)
        assert target.outline.area == 60 * 50
        calls.keep(calls.world.having(pointed=()))  # as in the next turn


def test_a_mask_is_no_argument_that_models_are_told_of() -> None:
    assert "mask" not in TargetPrompt.model_json_schema()["properties"]
    with pytest.raises(ValidationError, match="rings cross"):
        TargetPrompt(mask=Mask(rings=(SWAPPED,), found_in="it"))


def test_a_mask_elsewhere_is_refused() -> None:
    away = tuple((x + 500, y) for x, y in SQUARE)
    prompt = TargetPrompt(mask=Mask(rings=(away,), found_in="it"))
    assert prompt.problems(200, 140)[0].startswith("The mask lies outside the picture; ")
