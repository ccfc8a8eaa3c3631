"""What users install and import: the face, the wheel, how light it is."""

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import formup

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


def test_wheel_holds_every_package_and_data_file_and_no_tests(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir"]
    source = tmp_path / "source"
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    for name in listed:
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    subprocess.run([*command, str(tmp_path), str(source)], check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    inside = set(zipfile.ZipFile(wheel).namelist())
    rooms = ("agent", "apps", "evals", "prompts", "tools")
    kept = [n for n in listed if (ROOT / n).is_file() and (n.startswith(rooms) or "/" not in n)]
    data = (".py", ".yaml", ".md", ".json", ".jpg", ".png", ".css", ".js", "CURRENT")
    data += (".npz", ".txt", ".jsonl")
    wanted = [n for n in kept if n.endswith(data)]
    wanted += [n for n in listed if n.startswith("vendor/")]
    missing = [n for n in wanted if f"formup/{n}" not in inside and "/" in n]
    assert not missing
    assert {"formup/py.typed", "formup/__init__.py", "formup/__main__.py"} <= inside
    assert not [n for n in inside if "test" in n.split("/")[1]]
    assert not [n for n in inside if n.startswith(("formup/benchmarks/", "formup/examples/"))]


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
