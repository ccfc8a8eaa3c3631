"""CPU seconds from a large picture's file to the plan and its picture, beside decoding the file.

It does what `formup run BIG "Surround the car" --box ... -n 8 --plan-only` does; the start of the
interpreter and imports are not counted.
"""

import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from PIL import Image

from ..agent.agent import Agent
from ..evals.tasks.annotations import PHOTOS
from ..tools.context import Services, Settings
from ..tools.draw import draw_plan
from ..tools.perception.image import load_picture
from ..tools.perception.target_prompt import TargetPrompt
from .growth import show

PHOTO = PHOTOS / "images" / "cars_two.jpg"
BOX = np.array((320, 125, 470, 405)) / 768
"""Box around the red car, as fractions of the photograph's width."""
SIZES = {"12 MP": (4000, 3000), "50 MP": (8660, 5770)}
NOISE = 3.0
"""Standard deviation of camera noise, without which the picture would compress too well."""
REPEATS = 3


def rows() -> Iterator[str]:
    """Yield the table."""
    with TemporaryDirectory() as folder:
        place = Path(folder)
        _seconds_planned(PHOTO, place / "warm")
        small = min(_seconds_planned(PHOTO, place / f"small{k}") for k in range(REPEATS))
        yield f"{'CPU seconds':12} {'formup':>8} {'decoding':>8} {'ratio':>7}   best of {REPEATS}"
        yield f"{'0.3 MP jpg':12} {small:8.2f}"
        for name, size in SIZES.items():
            for kind in ("jpg", "png"):
                file = _enlarged(place / f"big.{kind}", size)
                ours = min(
                    _seconds_planned(file, place / f"{name}{kind}{k}") for k in range(REPEATS)
                )
                bare = min(_seconds_decoded(file) for _ in range(REPEATS))
                yield f"{name} {kind:6} {ours:8.2f} {bare:8.2f} {ours / bare:7.1f}"


def _enlarged(file: Path, size: tuple[int, int]) -> Path:
    """Write the photograph to a file, enlarged and with noise added."""
    large = cv2.resize(load_picture(PHOTO).pixels, size, interpolation=cv2.INTER_CUBIC)
    noise = np.random.default_rng(0).normal(0, NOISE, (*large.shape[:2], 1)).astype(np.float32)
    pixels = np.clip(large + noise, 0, 255).astype(np.uint8)
    Image.fromarray(pixels).save(file, quality=90, compress_level=3)
    return file


def _seconds_planned(file: Path, out: Path) -> float:
    out.mkdir()
    began = time.process_time()
    picture = load_picture(file)
    x0, y0, x1, y1 = (BOX * picture.width).tolist()
    run = Agent().run(
        picture,
        "Surround the car",
        pointed=[TargetPrompt(box=(x0, y0, x1, y1))],
        settings=Settings(robots=8, may_deploy=False),
        services=Services(found={}),
        trace=out / "trace.jsonl",
    )
    page = draw_plan(picture, run.world, run.world.plan().plan, run.report.instruction)
    page.save(out / "plan.png", compress_level=1)
    return time.process_time() - began


def _seconds_decoded(file: Path) -> float:
    began = time.process_time()
    Image.open(file).load()
    return time.process_time() - began


if __name__ == "__main__":
    show(rows())
