"""Things cut out of photographs and moved over them are followed as drawn ones are."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from formup.tools.geometry.outline import make_outline
from formup.tools.perception.tracking.tracker import ObjectTracker
from shapely import affinity

PHOTOS = Path(__file__).parents[4] / "evals/photos"
FRAMES = 16


@pytest.mark.parametrize(
    ("name", "id"),
    [("us_coins", "largest"), ("scissors_blue", "scissors"), ("ucm_airplane20", "big_plane")],
)
def test_a_thing_of_a_photograph_is_followed(name: str, id: str) -> None:
    listed = json.loads((PHOTOS / "annotations.json").read_text("utf-8"))
    (photo,) = (one for one in listed if Path(one["image"]).stem == name)
    (thing,) = (one for one in photo["objects"] if one["id"] == id)
    outline = make_outline(thing["polygon"])
    picture = cv2.imread(str(PHOTOS / photo["image"]))
    assert picture is not None
    height, width = picture.shape[:2]
    mask = np.zeros((height, width), np.uint8)
    cv2.fillPoly(mask, [np.round(outline.polygon.exterior.coords).astype(np.int32)], (255,))
    ground = cv2.inpaint(picture, cv2.dilate(mask, np.ones((9, 9))), 5, cv2.INPAINT_TELEA)
    random, centre = np.random.default_rng(0), np.array(outline.centre)
    way = 0.4 * (np.array([width / 2, height / 2]) - centre)
    tracker = None
    for frame in range(FRAMES):
        turn, moved = math.radians(1.5) * frame, way * frame / FRAMES
        cos, sin = math.cos(turn), math.sin(turn)
        matrix = np.array([[cos, -sin, 0], [sin, cos, 0]])
        matrix[:, 2] = centre + moved - matrix[:, :2] @ centre
        thing_now, share = (
            cv2.warpAffine(p, matrix, (width, height)).astype(float) for p in (picture, mask)
        )
        seen = ground + share[..., None] / 255 * (thing_now - ground)
        pixels = np.clip(seen + random.normal(0, 3, seen.shape), 0, 255).astype(np.uint8)
        if tracker is None:
            tracker = ObjectTracker(pixels, outline)
            continue
        found = tracker.update(pixels)
        assert not found.lost, (frame, found)
        off = math.hypot(found.dx - moved[0], found.dy - moved[1])
        truth, seen_at = (
            affinity.translate(
                affinity.rotate(outline.polygon, t, outline.centre, use_radians=True), x, y
            )
            for t, x, y in ((turn, *moved), (found.turn, found.dx, found.dy))
        )
        overlap = truth.intersection(seen_at).area / truth.union(seen_at).area
        assert overlap >= 0.95, (frame, off, overlap)
