"""The scale of a GeoTIFF is its file's; what says nothing sure gives none, and why.

The files are written here tag by tag, as GDAL does (compared with rasterio 1.4).
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.tools.context import Context, Settings
from formup.tools.perception.image import load_picture
from formup.tools.perception.imports.masks import masks_in
from formup.tools.perception.target_prompt import TargetPrompt
from PIL import Image, TiffImagePlugin

BOX = TargetPrompt(box=(75, 65, 145, 125))


def scene() -> Image.Image:
    made = np.full((200, 240, 3), 90, np.uint8)
    made[70:120, 80:140] = (200, 40, 40)
    return Image.fromarray(made)


def geotiff(
    folder: Path,
    crs: int,
    scale: tuple[float, float] | None = (0.1, 0.1),
    at: tuple[float, float] = (500_000, 5_200_000),
    *,
    model: int = 1,
    unit: int | None = 9001,
    matrix: list[float] | None = None,
) -> Path:
    keys = [(1024, model), (1025, 1), (3072 if model == 1 else 2048, crs)]
    keys += [(3076, unit)] if unit is not None and model == 1 else []
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[34735] = (1, 1, 0, len(keys), *(v for key, value in keys for v in (key, 0, 1, value)))
    tags.tagtype[34735] = 3
    numbers: dict[int, Any] = {} if matrix is None else {34264: tuple(matrix)}
    if matrix is None and scale is not None:
        numbers = {33550: (*scale, 0.0), 33922: (0.0, 0.0, 0.0, *at, 0.0)}
    for tag, values in numbers.items():
        tags[tag] = values
        tags.tagtype[tag] = 12
    scene().save(folder / "map.tif", tiffinfo=tags)
    return folder / "map.tif"


def turned(degrees: float, scale: float = 0.1) -> list[float]:
    c, s = scale * math.cos(math.radians(degrees)), scale * math.sin(math.radians(degrees))
    return [c, s, 0, 500_000, s, -c, 0, 5_200_000, 0, 0, 0, 0, 0, 0, 0, 1]


SCALES: dict[str, tuple[dict[str, Any], float]] = {
    "metres": ({"crs": 32632}, 0.1),
    "feet": ({"crs": 2263, "unit": 9003}, 0.1 * 1200 / 3937),
    "UTM without a unit": ({"crs": 32632, "unit": None}, 0.1),
    "turned a little": ({"crs": 32632, "matrix": turned(0.5)}, 0.1),
    "Web Mercator at 47 N": ({"crs": 3857, "at": (950_000, 5_944_000)}, 0.0682),
    "degrees at the equator": (
        {"crs": 4326, "model": 2, "scale": (1e-6, 1e-6), "at": (10, 0.0001)},
        0.111,
    ),
}
NONE: dict[str, tuple[dict[str, Any], str]] = {
    "uneven": ({"crs": 32632, "scale": (0.1, 0.2)}, "0.1 m wide and 0.2 m high"),
    "degrees at 47 N": (
        {"crs": 4326, "model": 2, "scale": (1e-6, 1e-6), "at": (8.5, 47.4)},
        "0.07549 m wide and 0.1112 m high",
    ),
    "turned": ({"crs": 32632, "matrix": turned(20)}, "turned or mirrored"),
    "unit unknown": ({"crs": 2263, "unit": None}, "unit of its map is not known"),
    "absurd": ({"crs": 32632, "scale": (1e-300, 1e300)}, "gives no scale"),
    "far too coarse": ({"crs": 32632, "scale": (9e4, 9e4)}, "none that a picture has"),
}


@pytest.mark.parametrize("kind", SCALES)
def test_a_scale_is_read(tmp_path: Path, kind: str) -> None:
    given, scale = SCALES[kind]
    picture = load_picture(geotiff(tmp_path, **given))
    assert picture.metres_per_pixel == pytest.approx(scale, rel=0.005)
    assert "from the file's georeference" in picture.notes[0]
    assert Context.of(picture).world.metres_per_pixel == picture.metres_per_pixel


@pytest.mark.parametrize("kind", NONE)
def test_no_scale_is_guessed(tmp_path: Path, kind: str) -> None:
    given, why = NONE[kind]
    picture = load_picture(geotiff(tmp_path, **given))
    assert picture.metres_per_pixel is None
    assert why in picture.notes[0]


def test_tags_that_say_nothing_sure_are_passed_over(tmp_path: Path) -> None:
    odds: tuple[dict[str, Any], ...] = (
        {"scale": (0.0, 0.1)},
        {"scale": (math.nan, 0.1)},
        {"scale": None},
        {"model": 3},
        {"matrix": [0.0] * 16},
        {"matrix": [1.0] * 5},
    )
    for odd in odds:
        picture = load_picture(geotiff(tmp_path, 32632, **odd))
        assert picture.place is None
        assert picture.notes == ()


@pytest.mark.parametrize("kind", ["png", "jpg", "tif"])
def test_a_resolution_for_printing_is_no_scale(tmp_path: Path, kind: str) -> None:
    scene().save(tmp_path / f"scene.{kind}", dpi=(254, 254))
    assert load_picture(tmp_path / f"scene.{kind}").metres_per_pixel is None


def test_metres_in_words_need_nothing_but_the_file(tmp_path: Path) -> None:
    picture = load_picture(geotiff(tmp_path, 32632))
    fixed = Settings(robots=4, may_deploy=False)
    run = Agent().run(picture, "Surround it, 1 m away", pointed=[BOX], settings=fixed)
    assert run.report.status == "planned", run.report.message
    assert run.report.metric is not None
    assert run.report.metric["metres_per_pixel"] == 0.1
    assert run.report.verdict is not None
    assert run.report.verdict.measures["min_clearance_px"] == pytest.approx(10, rel=0.1)


def test_a_scale_the_person_gives_wins_and_is_told(tmp_path: Path) -> None:
    picture = load_picture(geotiff(tmp_path, 32632))
    fixed = Settings(robots=4, may_deploy=False, metres_per_pixel=0.05)
    run = Agent().run(picture, "Surround it", pointed=[BOX], settings=fixed)
    assert run.world.metres_per_pixel == 0.05
    assert run.report.image is not None
    notes = run.report.image["notes"]
    assert "scale 0.1 m per pixel" in notes[0]
    assert notes[1] == "0.05 m per pixel is used, as the person gave it"


def test_geojson_of_the_same_map_lies_on_its_picture(tmp_path: Path) -> None:
    for crs, model, scale, (x, y) in (
        (32632, 1, 0.1, (500_000.0, 5_200_000.0)),
        (4326, 2, 1e-6, (8.5, 47.4)),
    ):
        path = geotiff(tmp_path, crs, (scale, scale), (x, y), model=model)
        picture = load_picture(path)
        corners = [(80, 70), (140, 70), (140, 120), (80, 120)]
        ring = [[x + scale * c, y - scale * r] for c, r in corners]
        data = json.dumps({"type": "Polygon", "coordinates": [ring]}).encode()
        (found,) = masks_in(data, "map.geojson", picture.size, picture)
        assert found.mask.region.bounds == pytest.approx((79.5, 69.5, 139.5, 119.5), abs=1e-3)
