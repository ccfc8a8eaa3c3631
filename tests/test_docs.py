"""What the README and the docs show is run, so that it stays true."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(language: str) -> list[tuple[str, str]]:
    return [
        (page.name, block)
        for page in PAGES
        for block in re.findall(rf"```{language}\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    ]


COMMANDS = [
    line.removeprefix("$ ")
    for _, block in blocks("console")
    for line in block.splitlines()
    if line.startswith("$ formup")
]


@pytest.mark.parametrize(("page", "code"), blocks("python"))
def test_python_blocks_run(page: str, code: str, tmp_path: Path) -> None:
    for folder in ("evals", "docs"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "deployed" in done.stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_run_as_written(command: str, tmp_path: Path) -> None:
    for folder in ("evals", "docs"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    arguments = [sys.executable, "-m", *shlex.split(command)]
    done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert ("deployed:" if command.startswith("formup run") else '"settled": true') in done.stdout


def test_there_is_something_to_run() -> None:
    assert len(COMMANDS) >= 3
    assert blocks("python")


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", page.read_text("utf-8")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_make_demo_points_at_the_things_it_names() -> None:
    makefile = (ROOT / "Makefile").read_text("utf-8")
    for name in ("cars_two.jpg", "ucm_sparseresidential28.jpg", "us_coins.jpg"):
        assert name in makefile
        assert (ROOT / "evals/photos/images" / name).is_file()
