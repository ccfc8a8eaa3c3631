"""Drawn scenes and words alone, through the command line: the right thing, or a question."""

import json
import subprocess
import sys
from pathlib import Path

from formup.evals.tasks.photographs import load_tasks


def test_words_alone_take_the_right_thing_or_ask(tmp_path: Path) -> None:
    out, kept = tmp_path / "rows.json", tmp_path / "scenes"
    arguments = ["eval", "scenes", "--seeds", "0-8", "--keep", str(kept), "--out", str(out)]
    command = [sys.executable, "-m", "formup", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "fresh words" in done.stdout
    found = json.loads(out.read_text("utf-8"))
    total = found["summary"]["total"]
    assert total["runs"] == 9
    assert total["placed"] >= 0.6
    assert total["right_of_placed"] == 1
    assert total["success_of_placed"] >= 0.9
    assert {"known words", "fresh words", "single", "multi", "hidden"} <= set(found["summary"])
    asked = [row for row in found["rows"] if row["status"] == "question"]
    assert all(row["right"] is None and not row["success"] for row in asked)
    tasks = load_tasks(kept)  # the pictures were kept
    assert [task.id for task in tasks] == [row["task"] for row in found["rows"]]
