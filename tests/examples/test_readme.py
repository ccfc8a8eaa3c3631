"""The README of the examples: it names what there is, and its packages work as it says."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
README = (EXAMPLES / "README.md").read_text("utf-8")
PIP = ["-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]


def test_it_names_every_example_and_links_lead_somewhere() -> None:
    examples = [*EXAMPLES.glob("*.*"), *EXAMPLES.glob("formup_*")]
    assert not [path.name for path in examples if path.name not in ("README.md", *named())]
    for target in re.findall(r"\]\((?!https?:|#)([^)#]+)\)", README):
        assert (EXAMPLES / target).exists(), target


def test_its_pictures_are_small_and_all_are_shown() -> None:
    shown = [EXAMPLES / name for name in re.findall(r"!\[[^]]+\]\((images/[^)]+)\)", README)]
    assert sorted(shown) == sorted((EXAMPLES / "images").iterdir())
    for path in shown:
        assert path.stat().st_size < 120_000, path
        with Image.open(path) as picture:
            assert picture.format == "JPEG"


def test_its_packages_are_installed_and_used(tmp_path: Path) -> None:
    (tmp_path / "evals").symlink_to(ROOT / "evals")
    for package in EXAMPLES.glob("formup_*"):
        shutil.copytree(package, tmp_path / "examples" / package.name)
    installed = tmp_path / "installed"
    paths = [str(installed), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    said: list[str] = []
    for block in re.findall(r"```console\n(.*?)```", README, re.DOTALL):
        for line in block.splitlines():
            program, *words = shlex.split(line.removeprefix("$ "))
            if program == "pip":
                command = [*PIP, "--target", str(installed), f"./{words[1]}"]
            else:
                command = ["-m", program, *words]
            done = subprocess.run(
                [sys.executable, *command],
                cwd=tmp_path,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == (3 if "--fleet" in words else 0), done.stdout + done.stderr
            said += re.findall(r"^(deployed|needs_approval):", done.stdout, re.MULTILINE)
    assert said == ["deployed", "needs_approval", "deployed"]


def named() -> list[str]:
    return re.findall(r"`([\w.]+)`", README)
