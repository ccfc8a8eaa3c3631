"""Pages on which the reader writes files first: the files are written, the commands run."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FILE = re.compile(r"`([\w./-]+\.\w+)`[^\n]*:\n\n```\w+\n(.*?)```", re.DOTALL)
"""A file: its name in the line above a block, which ends in a colon."""
PIP = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
ASKING = 3
"""The exit code of a run that waits for a person."""


def commands_of(page: str) -> list[tuple[str, list[str]]]:
    """Commands, each with the lines that are shown of its output."""
    found = list[tuple[str, list[str]]]()
    for block in re.findall(r"```console\n(.*?)```", page, re.DOTALL):
        for line in block.splitlines():
            if line.startswith("$ "):
                found.append((line.removeprefix("$ "), []))
            else:
                found[-1][1].append(line)
    return found


def arguments_of(command: str, installed: Path) -> list[str]:
    """What is started for a command; packages are installed into a folder, without a network."""
    program, *rest = shlex.split(command)
    if program == "pip":
        return [sys.executable, *PIP, "--target", str(installed), *rest[1:]]
    if program in ("formup", "pytest"):
        return [sys.executable, "-m", program, *rest]
    return [program, *rest]


@pytest.mark.parametrize("name", ["own-fleet.md", "own-segmenter.md", "own-suite.md"])
def test_the_page_works_from_its_first_command_to_its_last(name: str, tmp_path: Path) -> None:
    page = (ROOT / "docs" / name).read_text("utf-8")
    for folder in ("evals", "examples"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    for file, text in FILE.findall(page):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text(text, "utf-8")
    installed = tmp_path / "installed"
    paths = [str(installed), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    commands = commands_of(page)
    assert commands
    for command, shown in commands:
        if command.startswith("mkdir"):
            continue  # there by now: it holds a file
        done = subprocess.run(
            arguments_of(command, installed),
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        said = " ".join(done.stdout.split())
        expected = ASKING if any(line.startswith("needs_approval") for line in shown) else 0
        assert done.returncode == expected, f"{command}: {done.stdout}{done.stderr}"
        for line in shown:
            assert " ".join(line.split()) in said, command
