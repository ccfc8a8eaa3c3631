"""Mask files of other programs give the very regions they hold, or one sentence that says why not.

COCO's run lengths are written here from the published format, by another way than they are read.
"""

import io
import itertools
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from formup.tools.errors import InputError
from formup.tools.geometry.outline import outline_of
from formup.tools.perception.contours import mask_of_outline
from formup.tools.perception.image import Picture, load_picture, picture_from_array
from formup.tools.perception.imports.masks import Imported, masks_in
from numpy.typing import NDArray
from PIL import Image

PHOTOS = Path(__file__).parents[4] / "evals/photos"
CARS: dict[str, Any] = next(
    e
    for e in json.loads((PHOTOS / "annotations.json").read_text("utf-8"))
    if e["image"].endswith("cars_two.jpg")
)
SIZE = (CARS["width"], CARS["height"])
Mask = NDArray[np.bool_]


@pytest.fixture(scope="module")
def photo() -> Picture:
    return load_picture(PHOTOS / CARS["image"])


def ring_mask() -> Mask:
    """A disc with a hole, (H, W)."""
    y, x = np.ogrid[: SIZE[1], : SIZE[0]]
    far = (x - 300) ** 2 + (y - 200) ** 2
    return (far < 90**2) & (far > 40**2)


def counted(mask: Mask) -> list[int]:
    """Runs down the columns, beginning with zeros."""
    flat = mask.ravel(order="F").astype(int)
    changes = np.flatnonzero(np.diff(flat)) + 1
    ends = [0, *changes.tolist(), flat.size]
    runs = [int(b - a) for a, b in itertools.pairwise(ends)]
    return [0, *runs] if flat[0] else runs


def compressed(runs: list[int]) -> str:
    """COCO's text: from the third on the change to the run two before; 5 bits, low first."""
    text = ""
    for i, run in enumerate(runs):
        value = run - runs[i - 2] if i > 2 else run
        while True:
            bits, value = value & 31, value >> 5
            done = value == (-1 if bits & 16 else 0)
            text += chr(48 + (bits | (0 if done else 32)))
            if done:
                break
    return text


def rle(mask: Mask, *, packed: bool) -> dict[str, Any]:
    runs = counted(mask)
    return {"size": [SIZE[1], SIZE[0]], "counts": compressed(runs) if packed else runs}


def png(values: NDArray[Any], mode: str | None = None) -> bytes:
    file = io.BytesIO()
    image = Image.fromarray(values)
    if mode == "P":
        image.putpalette([v % 256 for v in range(768)])
    image.save(file, "PNG")
    return file.getvalue()


def read(content: Any, photo: Picture, name: str = "masks.json") -> list[Imported]:
    data = content if isinstance(content, bytes) else json.dumps(content).encode()
    return masks_in(data, name, photo.size, photo)


def pixels(found: Imported) -> Mask:
    return mask_of_outline(outline_of(found.mask.region), *SIZE)


def overlap(found: Imported, polygon: Any) -> float:
    true = shapely.Polygon(polygon)
    return found.mask.region.intersection(true).area / found.mask.region.union(true).area


@pytest.mark.parametrize("packed", [True, False], ids=["compressed", "uncompressed"])
def test_run_lengths_give_their_pixels_holes_kept(photo: Picture, packed: bool) -> None:
    mask = ring_mask()
    for content in (
        rle(mask, packed=packed),
        [{"image_id": 1, "category_id": 3, "segmentation": rle(mask, packed=packed)}],
    ):
        (found,) = read(content, photo)
        assert len(found.mask.rings) == 2
        assert np.count_nonzero(pixels(found) ^ mask) < 0.002 * mask.sum()


def test_a_png_is_a_mask_or_numbers_its_things(photo: Picture) -> None:
    mask, other = ring_mask(), np.zeros(SIZE[::-1], bool)
    other[300:400, 600:700] = True
    values = (mask * 7 + other * 9).astype(np.uint8)
    for data in (png(mask), png(mask.astype(np.uint8) * 255)):
        (found,) = read(data, photo, "mask.png")
        assert found.label == ""
        assert np.count_nonzero(pixels(found) ^ mask) < 0.002 * mask.sum()
    for data in (png(values), png(values.astype(np.uint16)), png(values, "P")):
        first, second = read(data, photo, "labels.png")
        assert (first.label, second.label) == ("value 7", "value 9")
        assert np.array_equal(pixels(second), other)


def test_soft_edges_voids_and_cut_outs_are_seen_for_what_they_are(photo: Picture) -> None:
    mask = ring_mask()
    soft = np.asarray(Image.fromarray(mask).convert("L").resize((300, 170)).resize(SIZE))
    assert len(read(png(soft), photo)) == 1
    bordered = np.where(mask, 1, 0).astype(np.uint8)
    bordered[150:160] = 255
    assert [f.label for f in read(png(bordered, "P"), photo)] == [""]
    cut = np.dstack([photo.pixels, mask.astype(np.uint8) * 255])
    assert np.count_nonzero(pixels(read(png(cut), photo)[0]) ^ mask) < 0.002 * mask.sum()
    with pytest.raises(InputError, match="colour picture, no mask"):
        read(png(photo.pixels), photo)


def coco(**image: Any) -> dict[str, Any]:
    about = {"id": 5, "file_name": "train/cars_two.jpg", "width": SIZE[0], "height": SIZE[1]}
    return {
        "images": [about | image, {"id": 6, "file_name": "b.jpg", "width": 9, "height": 9}],
        "categories": [{"id": 1, "name": "car"}],
        "annotations": [
            *(
                {"image_id": 5, "category_id": 1, "segmentation": [np.ravel(o["polygon"]).tolist()]}
                for o in CARS["objects"]
            ),
            {"image_id": 6, "category_id": 1, "segmentation": [[0, 0, 5, 0, 5, 5]]},
        ],
    }


def labelme(points: Any = None, **shape: Any) -> dict[str, Any]:
    drawn = [
        {"label": o["name"], "points": o["polygon"], "shape_type": "polygon"}
        for o in CARS["objects"]
    ]
    one = [{"label": "it", "points": points, "shape_type": "polygon"} | shape]
    shapes = drawn if points is None else one
    return {"shapes": shapes, "imageWidth": SIZE[0], "imageHeight": SIZE[1], "imageData": None}


def geojson(rings: list[Any]) -> dict[str, Any]:
    return {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"name": "car"},
                "geometry": {"type": "Polygon", "coordinates": [[*r, r[0]]]},
            }
            for r in rings
        ],
    }


def yolo() -> bytes:
    lines = [
        " ".join(map(str, [k, *np.ravel(np.asarray(o["polygon"]) / SIZE).tolist()]))
        for k, o in enumerate(CARS["objects"])
    ]
    return "\n".join(lines).encode()


FILES = {
    "coco": (coco(), "car"),
    "labelme": (labelme(), "silver car"),
    "geojson": (geojson([o["polygon"] for o in CARS["objects"]]), "car"),
    "yolo": (yolo(), "class 0"),
}


@pytest.mark.parametrize("kind", FILES)
def test_polygons_of_each_program_are_the_things_they_were_drawn_around(
    photo: Picture, kind: str
) -> None:
    content, label = FILES[kind]
    found = read(content, photo, f"{kind}.file")
    assert found[0].label == label
    assert len(found) == len(CARS["objects"])
    for one, thing in zip(found, CARS["objects"], strict=True):
        assert overlap(one, thing["polygon"]) > 0.98
        assert f"{kind}.file" in one.mask.found_in


def test_rectangles_circles_parts_and_holes_are_read(photo: Picture) -> None:
    (box,) = read(labelme([[330, 130], [470, 390]], shape_type="rectangle"), photo)
    assert box.mask.region.area == pytest.approx(140 * 260)
    (disc,) = read(labelme([[400, 260], [450, 260]], shape_type="circle"), photo)
    assert disc.mask.region.area == pytest.approx(np.pi * 50**2, rel=0.01)
    outer, inner = (
        [[330, 130], [470, 130], [470, 390], [330, 390]],
        [[380, 200], [420, 200], [420, 300]],
    )
    whole = {"type": "MultiPolygon", "coordinates": [[outer, inner]]}
    (holed,) = read(whole, photo)
    assert holed.mask.region.area == pytest.approx(140 * 260 - 2000)
    halves = [[330, 130, 470, 130, 470, 262, 330, 262], [330, 260, 470, 260, 470, 390, 330, 390]]
    (joined,) = read({"annotations": [{"segmentation": halves}]}, photo)
    assert joined.mask.region.area == pytest.approx(140 * 260)


def test_a_polygon_that_crosses_itself_is_mended_and_that_is_said(photo: Picture) -> None:
    ring = [list(p) for p in CARS["objects"][0]["polygon"]]
    ring[3], ring[4] = ring[4], ring[3]
    (found,) = read(labelme(ring), photo)
    assert "crossed itself" in found.mask.found_in
    assert overlap(found, CARS["objects"][0]["polygon"]) > 0.95


SCRIBBLE = np.random.default_rng(0).uniform(20, 400, (1500, 2)).tolist()
SQUARE = [[330, 130], [470, 130], [470, 390], [330, 390]]
SWAPPED = [[y, x] for x, y in CARS["objects"][0]["polygon"]]
REFUSED: dict[str, tuple[Any, str]] = {
    "another size": (coco(width=640, height=480), "640 x 480 px, and this one has 768 x 432 px"),
    "rows before columns": (coco(width=SIZE[1], height=SIZE[0]), "rows before columns"),
    "rows first in a polygon": (labelme(SWAPPED), "rows before columns"),
    "0 to 1 for pixels": (labelme([[0.1, 0.1], [0.4, 0.1], [0.4, 0.5]]), "numbers are from 0 to 1"),
    "pixels for 0 to 1": (b"0 330 130 470 130 470 390", "not from 0 to 1"),
    "a box": (b"0 0.5 0.5 0.2 0.2", "as a box has"),
    "longitudes": (geojson([[[8.54, 47.37], [8.55, 47.37], [8.55, 47.38]]]), "longitudes"),
    "beyond the picture": (labelme([[p[0] + 900, p[1]] for p in SQUARE]), "outside the picture"),
    "a line": (labelme([[10, 10], [20, 20], [30, 30]]), "less than 4 square px"),
    "no things": (labelme([], shape_type="polygon") | {"shapes": []}, "holds no things"),
    "all black": (png(np.zeros(SIZE[::-1], np.uint8)), "holds no things"),
    "empty": (b"", "holds no things"),
    "a point": ({"type": "Point", "coordinates": [3, 4]}, "is a 'Point'"),
    "a stroke": (labelme(SQUARE, shape_type="linestrip"), "is a 'linestrip'"),
    "other JSON": ({"robots": 4}, "none of the mask files"),
    "prose": (b"the red car", "none of the mask files"),
    "half of it": (json.dumps(labelme()).encode()[:200], "damaged"),
    "no number": (b'{"shapes": [{"points": [[NaN, 1], [2, 3], [4, 5]]}]}', "NaN"),
    "infinite": (b'{"shapes": [{"points": [[1e999, 1], [2, 3], [4, 5]]}]}', "no place"),
    "a scribble": (labelme(SCRIBBLE), "crosses itself"),
    "vast runs": ({"size": [432, 768], "counts": [10**18, 1]}, "do not fill"),
    "runs below 0": ({"size": [432, 768], "counts": [-1, 432 * 768 + 1]}, "do not fill"),
    "endless text": ({"size": [432, 768], "counts": "o" * 900}, "cannot be read"),
    "a vast mask": ({"size": [31623, 31623], "counts": [10**9]}, "31623 x 31623 px"),
    "nested": (b"[" * 100_000, "damaged"),
    "too many": (
        {"annotations": [{"segmentation": [np.ravel(SQUARE).tolist()]}] * 101},
        "101 things",
    ),
    "of two pictures": (
        coco(file_name="a.jpg"),
        "about several pictures, and none is called cars_two.jpg",
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_does_not_fit_is_refused_by_one_sentence(photo: Picture, kind: str) -> None:
    content, said = REFUSED[kind]
    began = time.process_time()
    with pytest.raises(InputError) as caught:
        read(content, photo, "mine.json")
    assert time.process_time() - began < 20  # a hostile file would take hours, or all memory
    sentence = str(caught.value)
    assert sentence.startswith("mine.json: ")
    assert said in sentence
    assert sentence.count("; ") >= 1 and sentence.endswith(".")


def test_a_region_without_an_edge_of_its_own_may_be_meant() -> None:
    plain = picture_from_array(np.full((432, 768, 3), 120, np.uint8))
    (found,) = masks_in(json.dumps(labelme(SQUARE)).encode(), "floor.json", SIZE, plain)
    assert found.mask.region.area == pytest.approx(140 * 260)
