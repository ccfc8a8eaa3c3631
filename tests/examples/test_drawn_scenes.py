"""The drawn scenes themselves, from the picture to where the robots were seen."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("scene", "relation", "robots"),
    [("car-park", "corners", 4), ("cage", "cage", 12), ("infill", "inside", 10)],
)
def test_a_scene_is_drawn_and_its_instruction_carried_out(
    tmp_path: Path, scene: str, relation: str, robots: int
) -> None:
    command = [sys.executable, str(ROOT / "examples/drawn_scenes.py"), scene, "--json"]
    command += ["--out", "out", "--film", "film.png", "--watch"]
    pytest.importorskip("pygame", reason="needs formup[sim]")
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env=os.environ | {"SDL_VIDEODRIVER": "dummy"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["status"] == "deployed" and report["arrival"]["arrived"]
    group = report["contract"]["groups"][0]
    assert (group["relation"], group["robots"]) == (relation, robots)
    assert report["files"]["film"] == "film.png" and (tmp_path / "film.png").exists()
