"""A suite of small pictures that the offline rules solve in a blink, for tests of sweeps."""

import json
from pathlib import Path

import numpy as np
from PIL import Image

SIDE = 40


def write_folder(folder: Path, tasks: int) -> Path:
    """A red square on grey, and so many tasks about it; the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    pixels = np.full((120, 160, 3), 90, np.uint8)
    pixels[40 : 40 + SIDE, 60 : 60 + SIDE] = (200, 40, 40)
    Image.fromarray(pixels).save(folder / "square.png")
    low, high = 60 - 0.5, 60 + SIDE - 0.5
    top, bottom = low - 20, high - 20
    ring = [[low, top], [high, top], [high, bottom], [low, bottom]]
    entry = {
        "image": "square.png",
        "width": 160,
        "height": 120,
        "objects": [{"id": "square", "name": "red square", "polygon": ring}],
        "tasks": [
            {
                "id": f"ring_{i:02d}",
                "instruction": f"Surround the red square with {6 + i % 9} robots.",
                "robots": 6 + i % 9,
                "category": "general" if i % 2 else "caging",
                "setup": "single",
                "target": "square",
                "success": {
                    "where": "boundary",
                    "band_px": [2.5, 16],
                    "max_gap_px": 420 / (6 + i % 9),
                    "even": True,
                },
            }
            for i in range(tasks)
        ],
    }
    (folder / "annotations.json").write_text(json.dumps([entry]))
    return folder
