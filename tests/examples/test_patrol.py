"""The patrol itself: both stops are driven to, at the distances that were asked for."""

import re
import subprocess
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[2]


def test_robots_stand_round_the_pool_and_then_round_the_house(tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(ROOT / "examples/patrol.py"), "round.jpg"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    stops = re.findall(r"(\w+): 8 robots, ([\d.]+) to ([\d.]+) m from it", done.stdout)
    assert [name for name, *_ in stops] == ["pool", "house"]
    for (_, near, far), wanted in zip(stops, (1.5, 2.0), strict=True):
        assert wanted - 0.06 < float(near) <= float(far) < wanted + 0.06
    with Image.open(tmp_path / "round.jpg") as picture:
        assert picture.width > 2 * picture.height  # two views
