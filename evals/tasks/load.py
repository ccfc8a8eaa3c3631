"""Reads suites: YAML files that give tasks in full, name photographs, or name drawn scenes by seed.

A folder of pictures in the photos' format with a suite.yaml beside it is a suite like the shipped
ones.
"""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import jsonschema
import yaml

from ...agent.report import Status
from ...tools.errors import InputError
from ...tools.store import write_whole
from ..scenes.build import entry_of, family_of, tell
from .photographs import Task, Thing, photos_folder, read_entries, rule_in_pixels
from .recipes.caged import caged
from .recipes.frontier import frontier
from .recipes.inscribed import inscribed
from .recipes.styled import styled
from .recipes.unmet import unmet
from .suite_task import SPLITS, Drawing, Split, Suite, SuiteTask

SCALE = "metres_per_pixel"
FILE = "suite.yaml"
"""In a folder of somebody's own."""
Entry = dict[str, Any]
ASKS: dict[str, Callable[[int, float | None], Entry]] = {
    "own": lambda seed, scale: entry_of(tell(seed)),
    "styled": styled,
    "frontier": frontier,
    "caged": lambda seed, scale: caged(seed),
    "unmet": lambda seed, scale: unmet(seed),
    "inscribed": lambda seed, scale: inscribed(seed),
}
"""What makes the entry of a seed; lengths are named in metres where there are metres per pixel."""
DEPLOYED: tuple[Status, ...] = ("deployed",)


def shipped() -> list[str]:
    """Names of the suites that ship with formup, sorted."""
    return sorted(path.stem for path in Path(__file__).parent.glob("*.yaml"))


def load_suite(name: str, split: str | None = None) -> Suite:
    """Read a suite; its pictures are not drawn yet.

    Args:
        name: of a shipped suite, or the path of a YAML file or of a folder with a suite.yaml.
        split: only its tasks; None for all.

    Raises:
        InputError: there is none, it is against the schema, or it has no such split.
    """
    if split is not None and split not in SPLITS:
        raise InputError(f"Unknown split {split!r}. There are: {', '.join(SPLITS)}.")
    if name in shipped():
        path = Path(__file__).parent / f"{name}.yaml"
    else:
        path = Path(name)
        path = path / FILE if path.is_dir() else path
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError:
        raise InputError(
            f"Unknown suite {name!r}. There are: {', '.join(shipped())}; or give a YAML file, or "
            f"a folder with a {FILE} (formup eval add makes one)."
        ) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not YAML: {' '.join(str(error).split())[:200]}.") from None
    _validate(content, path)
    families = _Families(content.get("splits", {}), split, path)
    tasks = tuple(t for item in content["tasks"] for t in _item(item, path, families))
    if not tasks:
        there = ", ".join(s for s in SPLITS if s in content.get("splits", {"dev": []}))
        raise InputError(f"{content['name']} has no tasks in the split {split}. It has: {there}.")
    repeated = sorted({t.id for t in tasks if sum(o.id == t.id for o in tasks) > 1})
    if repeated:
        raise InputError(f"{path} has more than one task {repeated[0]!r}; ids must differ.")
    return Suite(content["name"], " ".join(content["description"].split()), tasks)


def described(name: str) -> str:
    """What a shipped suite is, in its own words."""
    content = yaml.safe_load((Path(__file__).parent / f"{name}.yaml").read_text(encoding="utf-8"))
    return " ".join(content["description"].split())


def write_suite(folder: Path, name: str) -> Path:
    """Make a suite of a folder in the photos' format; the path of its YAML file.

    Raises:
        InputError: it has one already, or there is no annotations.json that can be read.
    """
    path = folder / FILE
    read_entries(folder / "annotations.json")
    if path.exists():
        raise InputError(f"{path} is there already; remove it to make it anew.")
    called = re.sub(r"[^a-z0-9_-]+", "-", name.lower()).strip("-_") or "mine"
    content = {
        "name": called,
        "description": f"Tasks on the pictures of {folder.name}.",
        "tasks": [{"folder": ".", "family": called}],
    }
    write_whole(path, yaml.safe_dump(content, sort_keys=False).encode())
    return path


def schema() -> dict[str, Any]:
    """The JSON Schema of suites."""
    return json.loads((Path(__file__).parent / "schema.json").read_text(encoding="utf-8"))


def _validate(content: Any, path: Path) -> None:
    errors = jsonschema.Draft202012Validator(schema()).iter_errors(content)
    problems = [f"{e.json_path}: {e.message[:160]}" for e in errors]
    if problems:
        raise InputError(f"{path} breaks the format of suites: {'; '.join(sorted(problems)[:3])}.")


@dataclass(frozen=True)
class _Families:
    """Which split a family is in, and whether it is wanted."""

    named: dict[str, list[str]]
    wanted: str | None
    path: Path

    def split(self, family: str) -> Split | None:
        """The split of a family; None if it is not wanted."""
        found: Split = "dev"
        if self.named:
            splits: list[Split] = [s for s in SPLITS if family in self.named.get(s, ())]
            if len(splits) != 1:
                raise InputError(
                    f"{self.path}: the family {family!r} is in {len(splits)} splits; every family "
                    "of its tasks must be in one."
                )
            found = splits[0]
        return found if self.wanted in (None, found) else None


def _item(item: Entry, path: Path, families: _Families) -> Iterator[SuiteTask]:
    """The tasks of one item of a suite's list."""
    must, named = bool(item.get("must_pass")), item.get("photos", "all")
    scale = {name: item[name] for name in (SCALE,) if name in item}
    for make, family, root in _entries(item, path):
        split = families.split(family)
        if split is None:
            continue
        entry = make() | scale
        for task in entry["tasks"]:
            if named == "all" or task["id"] in named:
                yield _task(entry, task, root, (family, split, must))


def _entries(item: Entry, path: Path) -> Iterator[tuple[Callable[[], Entry], str, Path]]:
    """What makes each entry in the photos' format, its family, the folder its image is in."""
    if "scenes" in item:
        ask = ASKS[item.get("ask", "own")]
        for seed in seeds(item["scenes"], path):
            yield (
                partial(ask, seed, item.get(SCALE)),
                item.get("family") or family_of(seed).name,
                Path(),
            )
        return
    if "photos" in item:
        source = photos_folder() / item.get("file", "annotations.json")
        entries = read_entries(source)
        known = {task["id"] for entry in entries for task in entry["tasks"]}
        missing = [] if item["photos"] == "all" else [n for n in item["photos"] if n not in known]
        if missing:
            raise InputError(f"{path}: there is no photograph's task {missing[0]!r}.")
    elif "folder" in item:
        source = path.parent / item["folder"] / "annotations.json"
        entries = read_entries(source)
    else:
        source, entries = path, read_entries(path, item["pictures"])
    for entry in entries:
        yield partial(dict, entry), item.get("family") or entry.get("family", ""), source.parent


def seeds(value: str | list[int], path: Path) -> list[int]:
    """Seeds as listed, or as a range A-B.

    Raises:
        InputError: no such range.
    """
    if isinstance(value, list):
        return value
    first, last = (int(n) for n in re.findall(r"[0-9]+", value))
    if not first <= last < first + 10_000:
        raise InputError(f"{path}: scenes {value!r} is no range of at most 10,000 seeds.")
    return list(range(first, last + 1))


def _task(entry: Entry, task: Entry, root: Path, placed: tuple[str, Split, bool]) -> SuiteTask:
    family, split, must_pass = placed
    expects: tuple[Status, ...] = tuple(task.get("expects", DEPLOYED))
    drawn = re.fullmatch(r"scene_([0-9]{6,})\.png", entry["image"]) if root == Path() else None
    if drawn:
        picture = Drawing(int(drawn[1]), entry.get("inscription", ""))
    else:
        picture = root / entry["image"]
    goals = task.get("goals", [task] if "deployed" in expects else [])
    return SuiteTask(
        id=task["id"],
        instruction=task["instruction"],
        robots=task["robots"],
        category=task["category"],
        setup=task["setup"],
        family=family,
        split=split,
        style=task.get("style", task.get("wording", "")),
        goals=tuple(_goal(entry, task, goal, picture) for goal in goals),
        expects=expects,
        picture=picture,
        must_pass=must_pass,
        metres_per_pixel=entry.get(SCALE),
    )


def _goal(entry: Entry, task: Entry, goal: Entry, picture: Path | Drawing) -> Task:
    things = {
        o["id"]: Thing(o["id"], o["name"], o["polygon"], o.get("holes", []))
        for o in entry["objects"]
    }
    other = goal["success"].get("other")
    for name in filter(None, (goal["target"], other)):
        if name not in things:
            raise InputError(f"Task {task['id']} names {name!r}, which is not in its picture.")
    return Task(
        id=task["id"],
        instruction=task["instruction"],
        robots=goal["robots"],
        category=task["category"],
        setup=task["setup"],
        image=picture if isinstance(picture, Path) else Path(picture.name),
        size=(entry["width"], entry["height"]),
        target=things[goal["target"]],
        success=rule_in_pixels(entry, task, goal["success"]),
        other=things[other] if other else None,
        referring=task.get("referring", ""),
        wording=task.get("wording", ""),
        metres_per_pixel=entry.get(SCALE),
    )
