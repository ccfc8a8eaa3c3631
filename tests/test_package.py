"""What users install and import: the face, the wheel, how light it is."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import formup
import pytest

ROOT = Path(__file__).parent.parent


def test_public_names_are_sorted_and_exist() -> None:
    assert formup.__all__ == sorted(formup.__all__)
    for name in formup.__all__:
        assert getattr(formup, name) is not None
    assert dir(formup) == formup.__all__


def test_public_names_are_the_ones_a_checker_sees() -> None:
    text = (ROOT / "__init__.py").read_text(encoding="utf-8")
    block = text.partition("if TYPE_CHECKING:")[2].partition("_HOMES")[0]
    for name in formup.__all__:
        assert name in block


def test_unknown_name_is_an_attribute_error() -> None:
    assert not hasattr(formup, "nonsense")


def test_import_loads_nothing_heavy() -> None:
    code = (
        "import sys, formup; heavy = {'numpy', 'cv2', 'scipy', 'shapely', 'pydantic', 'PIL', "
        "'httpx', 'torch', 'yaml'} & set(sys.modules); sys.exit(', '.join(heavy) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_planner_runs_without_the_libraries_it_does_not_need() -> None:
    code = (
        "import sys; from formup import Agent; Agent(); "
        "sys.exit(', '.join({'scipy', 'httpx', 'torch', 'typer', 'rich'} & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def listed() -> list[str]:
    """The files that are, or are about to be, in the repository."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [name for name in done.stdout.splitlines() if (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the source archive, and of the wheel that was built out of that archive."""
    source, home = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("built")
    for name in listed():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_bytes((ROOT / name).read_bytes())
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(home), str(source)]
    subprocess.run(command, check=True, capture_output=True)
    return home


def test_wheel_holds_every_package_and_data_file_and_no_tests(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    inside = set(zipfile.ZipFile(wheel).namelist())
    rooms = ("agent", "apps", "evals", "prompts", "tools")
    kept = [n for n in listed() if n.startswith(rooms) or "/" not in n]
    data = (".py", ".yaml", ".md", ".json", ".jpg", ".png", ".css", ".js", "CURRENT")
    data += (".npz", ".txt", ".jsonl")
    wanted = [n for n in kept if n.endswith(data)]
    wanted += [n for n in listed() if n.startswith("vendor/")]
    missing = [n for n in wanted if f"formup/{n}" not in inside and "/" in n]
    assert not missing
    assert {"formup/py.typed", "formup/__init__.py", "formup/__main__.py"} <= inside
    assert not [n for n in inside if "test" in n.split("/")[1]]
    assert not [n for n in inside if n.startswith(("formup/benchmarks/", "formup/examples/"))]


def test_an_index_would_take_both_archives(built: Path) -> None:
    command = [sys.executable, "-m", "twine", "check", "--strict", *map(str, built.iterdir())]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("PASSED") == 2


def test_the_wheel_alone_runs_the_demonstration(built: Path, tmp_path: Path) -> None:
    (wheel,) = built.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    command = [sys.executable, "-P", "-m", "formup", "demo", "--out", "demo"]
    here = os.environ | {"PYTHONPATH": str(tmp_path / "site")}
    done = subprocess.run(
        command, cwd=tmp_path, env=here, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    commands = re.findall(r"^\$ formup run (\S+)", done.stdout, re.MULTILINE)
    assert len(commands) == 4
    assert all(picture.startswith(str(tmp_path / "site")) for picture in commands)
    assert done.stdout.count("\ndeployed: ") == 4
    for name in ("car", "pool", "coin", "lot"):
        assert (tmp_path / "demo" / name / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_one_extra_brings_all_but_the_heavy_ones() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    (every,) = extras["all"]
    apart = {"all", "dev", "docs", "ray", "rl", "torch"}
    assert set(every.removeprefix("formup[").removesuffix("]").split(",")) == set(extras) - apart


def test_shells_complete_commands() -> None:
    asked = {"_FORMUP_COMPLETE": "complete_bash", "COMP_WORDS": "formup d", "COMP_CWORD": "1"}
    command = [str(Path(sys.executable).parent / "formup")]
    done = subprocess.run(
        command, env=os.environ | asked, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["deploy", "demo", "doctor"]


def test_every_package_is_listed() -> None:
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"][
        "packages"
    ]
    found = {
        ".".join(("formup", *p.parent.relative_to(ROOT).parts))
        for room in ("agent", "apps", "evals", "prompts", "tools")
        for p in (ROOT / room).rglob("__init__.py")
    }
    assert set(packages) == found | {"formup"}
