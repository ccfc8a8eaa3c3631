"""GEPA itself, with a script in place of the model that reflects: from its draft to the gate."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from formup.apps.cli import app
from formup.prompts import PromptLibrary

pytest.importorskip("gepa", reason="needs gepa, which is among the extras for development")
write_folder: Callable[[Path, int], Path] = import_module("synthetic").write_folder

ROOT = Path(__file__).parents[2]
SAID, FORGOTTEN = "call deploy with `tell` alone", "hand it over with `tell` alone"
"""Without it half of the trials of the simulated model stop at the plan."""
REFLECT = f"""
import sys
text = sys.stdin.read()
assert "The plan is certified" in text, text
print("```", text.split("```")[1].replace({FORGOTTEN!r}, {SAID!r}), "```")
"""


def formup(*words: str) -> None:
    assert not app(words, standalone_mode=False)


def test_a_draft_is_made_on_train_alone_and_passes_the_gate_on_dev(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tasks = [{"folder": name, "family": name} for name in ("learn", "judge")]
    for name, count in (("learn", 4), ("judge", 8)):
        annotations = write_folder(tmp_path / name, count) / "annotations.json"
        told = annotations.read_text("utf-8").replace("ring_", f"{name}_")
        annotations.write_text(told, "utf-8")
    splits = {"train": ["learn"], "dev": ["judge"]}
    suite = {"name": "squares", "description": "Squares.", "tasks": tasks, "splits": splits}
    (tmp_path / "squares.yaml").write_text(yaml.safe_dump(suite), "utf-8")
    (tmp_path / "reflect.py").write_text(REFLECT, "utf-8")
    formup("prompts", "new", "brisk@draft-1", "--from", "former", "--prompts", "mine")
    draft = tmp_path / "mine/brisk/draft-1.prompt.md"
    draft.write_text(draft.read_text("utf-8").replace(SAID, FORGOTTEN), "utf-8")
    formup("prompts", "release", "brisk@draft-1", "--why", "to begin with", "--prompts", "mine")
    command = [sys.executable, str(ROOT / "examples/optimise_prompt.py"), "--prompt", "brisk"]
    command += ["--suite", "squares.yaml", "--model", "simulated", "--calls", "8"]
    command += ["--reflect", f"{sys.executable} reflect.py", "--trials", "2", "--out", "run"]
    done = subprocess.run(
        command, env=os.environ, capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "gate: pass" in done.stdout
    library = PromptLibrary(tmp_path / "mine")
    assert SAID in library.load("brisk@draft-gepa").text
    assert SAID not in library.load("brisk").text  # nothing is released by itself
    assert [name for name in library.names() if name.startswith("brisk@draft")] == [
        "brisk@draft-gepa"
    ]
    for split, family in (("train", "learn"), ("dev", "judge")):
        lines = (tmp_path / "run" / split / "trials.jsonl").read_text("utf-8").splitlines()
        assert {json.loads(line)["task"].split("_")[0] for line in lines} == {family}
    report = ("--report", "run/gate.json", "--prompts", "mine")
    formup("prompts", "release", "brisk@draft-gepa", "--why", "drafted by GEPA", *report)
    formup("prompts", "promote", "brisk@v002", *report)
