"""Drawn scenes and words alone, through the command line: the right thing, or a question."""

import json
import subprocess
import sys
from pathlib import Path

from formup.evals.experiments.journal import read_rows


def test_words_alone_take_the_right_thing_or_ask(tmp_path: Path) -> None:
    out = tmp_path / "run"
    arguments = ["eval", "run", "scenes", "--seeds", "0-8", "--out", str(out)]
    command = [sys.executable, "-m", "formup", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "fresh" in done.stdout
    (arm,) = json.loads((out / "summary.json").read_text("utf-8"))["arms"].values()
    found = {cell["name"]: cell for cell in arm}
    total = found["total"]
    assert total["scored"] == 9
    assert total["placed"] >= 0.6 * 9
    assert total["right_thing"] == [total["placed"], total["placed"]]
    assert total["placed_passed"] >= 0.9 * total["placed"]
    assert {"known", "fresh", "single", "multi", "hidden"} <= set(found)
    asked = [row for row in read_rows(out) if row.outcome == "question"]
    assert asked
    assert all(not row.sr and not row.placed for row in asked)
    assert len(list((out / "pictures").glob("scene_*.png"))) == 9
