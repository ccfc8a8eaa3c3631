"""The picture as a model is shown it: places read off it are places in the photograph."""

from io import BytesIO
from typing import Any

import numpy as np
import pytest
from formup.tools.draw import draw_view, view_scale
from formup.tools.errors import ToolError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import make_plan
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt
from formup.tools.world import Target, World
from numpy.typing import NDArray
from PIL import Image

RULERS = (52, 30)
"""Room at the right and at the lower edge, px."""


def bare(width: int, height: int) -> Picture:
    """Grey, with a bright spot of 5 px in its right lower half."""
    pixels = np.full((height, width, 3), 120, np.uint8)
    y, x = spot(width, height)
    pixels[y - 2 : y + 3, x - 2 : x + 3] = (255, 255, 0)
    return picture_from_array(pixels)


def box() -> Target:
    outline = make_outline([(100, 100), (200, 100), (200, 200), (100, 200)])
    return Target(
        id="t1", label="box", box=outline.bounds, confidence=0.9, outline=outline, prompt="box"
    )


def view_of(picture: Picture, **more: Any) -> bytes:
    """The view where nothing has been found yet."""
    return draw_view(picture, World.of(picture), **more)


def spot(width: int, height: int) -> tuple[int, int]:
    return int(height * 0.7), int(width * 0.8)


def shown(view: bytes) -> NDArray[np.int16]:
    with Image.open(BytesIO(view)) as image:
        assert image.format == "JPEG"
        return np.asarray(image.convert("RGB")).astype(np.int16)


def spot_at(view: bytes) -> tuple[float, float]:
    """Middle (x, y) of what is yellow."""
    pixels = shown(view)
    rows, columns = np.nonzero((pixels[..., 0] > 190) & (pixels[..., 2] < 80))
    return float(columns.mean()), float(rows.mean())


@pytest.mark.parametrize(
    ("size", "scale"),
    [((768, 432), 1), ((1024, 600), 1), ((400, 300), 1), ((2048, 900), 0.5), ((150, 90), 3)],
)
def test_the_photograph_lies_at_the_upper_left_at_a_known_scale(
    size: tuple[int, int], scale: float
) -> None:
    picture = bare(*size)
    assert view_scale(picture) == scale
    view = view_of(picture)
    height, width = shown(view).shape[:2]
    assert (width, height) == (size[0] * scale + RULERS[0], size[1] * scale + RULERS[1])
    y, x = spot(*size)
    expected = ((x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5)
    assert spot_at(view) == pytest.approx(expected, abs=0.6)


@pytest.mark.parametrize("size", [(50_000, 16), (16, 4000), (16, 16), (6000, 5000)])
def test_no_view_is_larger_than_providers_take(size: tuple[int, int]) -> None:
    picture = picture_from_array(np.full((size[1], min(size[0], 20_000), 3), 9, np.uint8))
    height, width = shown(view_of(picture)).shape[:2]
    assert 400 <= max(width, height) <= 1024 + max(RULERS)


def ticks(strip: NDArray[np.int16]) -> NDArray[np.int64]:
    """Where a row or column of the rulers begins to be dark."""
    dark = strip.sum(axis=-1) < 300
    return np.flatnonzero(dark & ~np.append(False, dark[:-1]))


@pytest.mark.parametrize("region", [None, (200, 100, 500, 300), (333, 7, 400, 41)])
def test_the_rulers_count_the_photographs_own_pixels(
    region: tuple[float, float, float, float] | None,
) -> None:
    picture = bare(768, 432)
    view = shown(view_of(picture, region=region))
    x0, y0, x1, y1 = region or (0, 0, 768, 432)
    height, width = view.shape[0] - RULERS[1], view.shape[1] - RULERS[0]
    for axis, first, last, strip in (
        (0, x0, x1, view[height + 2, :width]),
        (1, y0, y1, view[:height, width + 2]),
    ):
        scale = (width, height)[axis] / (last - first)
        values = (ticks(strip)[1:] + 0.75) / scale - 0.5 + first
        step = round(float(np.diff(values).mean()))
        assert step >= 1
        off = max(abs(float(v) - step * round(float(v) / step)) for v in values)
        assert off < 1.5 / scale + 0.1


def test_a_part_is_shown_closer_and_cut_at_the_pictures_border() -> None:
    picture = bare(768, 432)
    y, x = spot(768, 432)
    found = spot_at(view_of(picture, region=(x - 20, y - 20, x + 20, y + 20)))
    assert found == pytest.approx((20.5 * 768 / 40, 20.5 * 768 / 40), abs=2)
    corner = shown(view_of(picture, region=(600, 300, 5000, 5000)))
    assert corner.shape[1] - RULERS[0] == 768
    assert corner.shape[0] - RULERS[1] == round(768 * 132 / 168)


def test_targets_and_robots_are_drawn_where_they_are() -> None:
    picture = bare(600, 400)
    world = World.of(picture).with_target(box())
    contract = Contract(groups=(Group(relation="corners", targets=("t1",), robots=4),))
    plan = make_plan(contract, world.site(contract), world.version_of(contract))
    plain, view = shown(view_of(picture)), shown(draw_view(picture, world, plan=plan))
    changed = np.abs(plain - view).sum(axis=2) > 60
    assert changed[150, 96:104].any()  # the left edge
    for x, y in plan.formation.points.round().astype(int):
        assert changed[y - 3 : y + 4, x - 3 : x + 4].all()
    assert not changed[300:395, 300:500].any()


def test_an_outline_drawn_its_points_and_what_it_was_before_are_drawn() -> None:
    picture, world = bare(400, 300), World.of(bare(400, 300), targets=(box(),))
    region = (90, 90, 210, 210)
    corners = ((110, 110), (190, 110), (190, 190), (110, 190))
    drawn = TargetPrompt(outline=corners, points=((130, 150),), negative=((170, 150),))
    before = make_outline([(120, 120), (180, 120), (180, 180), (120, 180)])
    plain = shown(draw_view(picture, world, region=region))
    view = shown(draw_view(picture, world, region=region, drawn=drawn, before=before))
    changed = np.abs(view - plain).max(axis=2) > 60
    scale = 768 / 120
    for x, y, reach in ((150, 110, 12), (150, 120, 12), (130, 150, 2), (170, 150, 2)):
        u, v = ((np.array([x, y]) - 90 + 0.5) * scale).astype(int)
        r = round(reach * scale / 2)
        assert changed[v - r : v + r, u - r : u + r].any(), (x, y)
    u, v = ((np.array([150, 150]) - 90) * scale).astype(int)
    assert not changed[v - 20 : v + 20, u - 20 : u + 20].any()


def test_a_plan_about_a_target_that_is_gone_is_refused() -> None:
    picture = bare(600, 400)
    whole = World.of(picture).with_target(box())
    contract = Contract(groups=(Group(relation="around", targets=("t1",), robots=4),))
    plan = make_plan(contract, whole.site(contract), whole.version_of(contract))
    with pytest.raises(ToolError, match="'t1'"):
        view_of(picture, plan=plan)
