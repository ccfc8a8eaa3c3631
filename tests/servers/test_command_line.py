"""`formup run` as a person types it, with a model on a server that others wrote."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image


def formup(asked: Any, name: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """The environment holds the key."""
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    Image.fromarray(pixels).save(folder / "scene.png")
    words = ["scene.png", "Surround the red thing with 6 robots", "--plan-only", "--json"]
    model = ["--model", f"{asked.place.provider}:{name}", "--base-url", asked.url]
    command = [sys.executable, "-m", "formup", "run", *words, *model]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def test_a_run_is_planned(asked: Any, tmp_path: Path) -> None:
    done = formup(asked, asked.name, tmp_path)
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)
    assert (data["status"], data["message"]) == ("planned", "Six robots have a place.")
    assert data["model"] == f"{asked.place.provider}:{asked.name}"
    assert data["verdict"]["certified"] is True
    assert len(data["positions"]) == 6
    assert data["usage"]["requests"] == 2


def test_an_unknown_model_is_exit_code_4(asked: Any, tmp_path: Path) -> None:
    done = formup(asked, "nobody", tmp_path)
    assert done.returncode == 4, done.stderr
    data = json.loads(done.stdout)
    assert data["status"] == "failed"
    assert "nobody" in data["message"]
    assert "Traceback" not in done.stderr
