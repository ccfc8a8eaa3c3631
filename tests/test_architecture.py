"""The house rules that a reader should be able to rely on: who imports whom, and sizes."""

import ast
from collections import Counter
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ROOMS = ("tools", "prompts", "agent", "evals", "apps", "benchmarks")
MAY_IMPORT = {
    "tools": {"tools"},
    "prompts": {"prompts"},
    "agent": {"agent", "tools", "prompts"},
    "evals": {"evals", "agent", "tools", "prompts"},
    "apps": {"apps", "evals", "agent", "tools", "prompts"},
    "benchmarks": {"benchmarks", "evals", "agent", "tools", "prompts"},
}
WITHIN_TOOLS = {
    "geometry": {"geometry", "errors"},
    "perception": {"perception", "geometry", "registry", "errors", "yaml_files"},
    "formation": {"formation", "geometry", "errors"},
    "motion": {"motion", "formation", "geometry", "errors"},
    "fleet": {
        "fleet",
        "motion",
        "formation",
        "perception",
        "geometry",
        "errors",
        "registry",
        "yaml_files",
    },
}
GEOMETRY_LIBRARIES = {"numpy", "scipy", "shapely"}
HEAVY = {
    "torch",
    "transformers",
    "ray",
    "mcp",
    "opentelemetry",
    "paho",
    "pygame",
    "stable_baselines3",
    "scipy",
    "websockets",
}
SOURCES = sorted(p for room in ROOMS for p in (ROOT / room).rglob("*.py"))
EXAMPLES = sorted((ROOT / "examples").rglob("*.py"))
PROGRAMS = [path for path in EXAMPLES if path.parent.name == "examples"]
EVERYTHING = [*SOURCES, *EXAMPLES, *ROOT.glob("*.py"), *(ROOT / "tests").rglob("*.py")]


def names(paths: list[Path]) -> list[str]:
    return [str(p.relative_to(ROOT)) for p in paths]


def imports(path: Path, *, top_level: bool = False) -> Iterator[tuple[int, str]]:
    """(relative level, dotted module) of every import of a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = ast.iter_child_nodes(tree) if top_level else ast.walk(tree)
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = node.module or ""
            if module:
                yield node.level, module
            else:
                yield from ((node.level, alias.name) for alias in node.names)


def resolved(path: Path) -> Iterator[tuple[str, ...]]:
    """Modules of this package a file imports, as paths from the root."""
    here = path.relative_to(ROOT).parts
    for level, module in imports(path):
        if level:
            yield (*here[: len(here) - level], *module.split("."))


@pytest.mark.parametrize("path", SOURCES, ids=names(SOURCES))
def test_data_flows_one_way(path: Path) -> None:
    room = path.relative_to(ROOT).parts[0]
    for target in resolved(path):
        assert target[0] in MAY_IMPORT[room], f"{room} must not import {'.'.join(target)}"


@pytest.mark.parametrize("path", SOURCES, ids=names(SOURCES))
def test_within_tools_data_goes_from_picture_to_fleet(path: Path) -> None:
    parts = path.relative_to(ROOT).parts
    if parts[0] != "tools" or parts[1] not in WITHIN_TOOLS:
        return
    for target in resolved(path):
        assert target[1] in WITHIN_TOOLS[parts[1]], f"{parts[1]} must not import {target}"


@pytest.mark.parametrize("path", SOURCES, ids=names(SOURCES))
def test_libraries_stay_in_their_rooms(path: Path) -> None:
    place = path.relative_to(ROOT).as_posix()
    modules = {module.partition(".")[0] for level, module in imports(path) if not level}
    if not place.startswith(("tools/perception/", "tools/draw/", "benchmarks/")):
        assert "cv2" not in modules
    if not place.startswith(("agent/providers/", "benchmarks/loop/")):
        assert not modules & {"httpx", "httpx2", "requests", "aiohttp"}
    if place.startswith("tools/geometry/"):
        outside = modules - GEOMETRY_LIBRARIES - set(__import__("sys").stdlib_module_names)
        assert not outside


@pytest.mark.parametrize("path", SOURCES, ids=names(SOURCES))
def test_heavy_libraries_are_imported_where_they_are_used(path: Path) -> None:
    if path.relative_to(ROOT).parts[0] in ("evals", "benchmarks"):
        return  # nothing a user waits for imports the graders
    if path.parent == ROOT / "apps/mcp" and path.name != "command.py":
        return  # loaded by its command alone, and by a server: see tests/apps/mcp/test_stdio.py
    modules = {m.partition(".")[0] for n, m in imports(path, top_level=True) if not n}
    assert not modules & HEAVY


@pytest.mark.parametrize("path", EVERYTHING, ids=names(EVERYTHING))
def test_no_absolute_import_of_a_room(path: Path) -> None:
    """It would load a second copy of the module beside formup's."""
    absolute = {module.partition(".")[0] for level, module in imports(path) if not level}
    assert not absolute & set(ROOMS)


@pytest.mark.parametrize("path", EVERYTHING, ids=names(EVERYTHING))
def test_files_and_functions_stay_small(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 400
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            assert node.end_lineno is not None
            assert node.end_lineno - node.lineno < 50, f"{node.name} is too long"


def modules_imported(path: Path, known: dict[tuple[str, ...], Path]) -> set[Path]:
    """Files of this package that a file imports while it is itself imported."""
    here = path.relative_to(ROOT).parts
    found: set[Path] = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.level:
            base = (*here[: len(here) - node.level], *(node.module or "").split("."))
            base = tuple(part for part in base if part)
            inside = [known.get((*base, alias.name)) for alias in node.names]
            found |= {file or known[base] for file in inside if file or base in known}
    return found - {path}


def test_no_modules_import_each_other_in_a_circle() -> None:
    known = {p.relative_to(ROOT).with_suffix("").parts: p for p in SOURCES}
    known |= {parts[:-1]: p for parts, p in known.items() if parts[-1] == "__init__"}
    graph = {path: modules_imported(path, known) for path in SOURCES}
    assert list(TopologicalSorter(graph).static_order())  # raises CycleError, which names them


@pytest.mark.parametrize("path", PROGRAMS, ids=names(PROGRAMS))
def test_examples_use_the_public_face(path: Path) -> None:
    """Packages that add to formup also import its protocols."""
    assert not [m for level, m in imports(path) if level or m.startswith("formup.")]


@pytest.mark.parametrize("path", EXAMPLES, ids=names(EXAMPLES))
def test_examples_fit_on_a_screen_or_two(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) < 100


def test_private_helpers_of_one_name_are_two_at_most() -> None:
    counts = Counter(
        node.name
        for path in SOURCES
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("_")
    )
    assert not {name: n for name, n in counts.items() if n > 2}


def test_modules_say_why_they_exist_in_five_lines() -> None:
    for path in SOURCES:
        docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
        assert docstring, f"{path} does not say why it exists"
        if path.name != "errors.py":  # opens with the tree of exceptions drawn out
            assert len(docstring.splitlines()) <= 6, f"{path} says it at length"


def test_traps_of_a_root_package_are_kept_out() -> None:
    assert not (ROOT / "conftest.py").exists()
    assert not list((ROOT / "tests").rglob("__init__.py"))
