"""Reader of suites: YAML files with tasks in full, names of photographs, or seeds of scenes.

A folder of pictures with an annotations.json is a suite too, with or without a suite.yaml.
"""

import json
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from ...tools.errors import InputError
from ...tools.store import write_whole
from ..scenes.stories import entry_of, family_of, story_of
from .annotations import ANNOTATIONS, PHOTOS, SCALE, Entry, check_format, read_entries, task_of
from .dialogues import dialogue_task, dialogues_in
from .frames import check_frame
from .recipes.caged import caged
from .recipes.frontier import frontier
from .recipes.inscribed import inscribed
from .recipes.styled import styled
from .recipes.unmet import unmet
from .task import SPLITS, Split, Suite, Task

FILE = "suite.yaml"
"""Name of the suite's file in a folder of the user's own."""
HERE = Path(__file__).parent
RECIPES: dict[str, Callable[[int, float | None], Entry]] = {
    "own": lambda seed, scale: entry_of(story_of(seed)),
    "styled": styled,
    "frontier": frontier,
    "caged": lambda seed, scale: caged(seed),
    "unmet": lambda seed, scale: unmet(seed),
    "inscribed": lambda seed, scale: inscribed(seed),
}
"""Functions (seed, metres per pixel) that make an entry; a scale has lengths named in metres."""


def shipped() -> list[str]:
    """Return the names of the suites that ship with formup, sorted."""
    return sorted(path.stem for path in HERE.glob("*.yaml"))


def load_suite(name: str, split: str | None = None, seeds: str | None = None) -> Suite:
    """Read a suite; its pictures are not drawn yet.

    Args:
        name: of a shipped suite, or the path of a YAML file, of a folder with a suite.yaml or an
            annotations.json, or of a file in that format with another name.
        split: the only one whose tasks are read; None for all.
        seeds: a range A-B, or A, instead of the seeds of a suite of drawn scenes.

    Raises:
        InputError: there is none, it breaks the schema, or it has no such split or seeds.
    """
    if split is not None and split not in SPLITS:
        raise InputError(f"Unknown split {split!r}. There are: {', '.join(SPLITS)}.")
    path = _suite_path(name)
    content = annotated(path) if path.suffix == ".json" else _read_yaml(path, name)
    check_format(content, schema(), f"{path} breaks the format of suites")
    if seeds is not None:
        if len(content["tasks"]) > 1 or "scenes" not in content["tasks"][0]:
            raise InputError(f"{content['name']} is not made of one range of seeds, as scenes is.")
        content["tasks"][0]["scenes"] = seeds
    splits = content.get("splits", {})
    items = content["tasks"]
    tasks = tuple(task for item in items for task in _tasks_of_item(item, path, splits, split))
    if not tasks:
        there = ", ".join(s for s in SPLITS if s in (splits or ["dev"]))
        raise InputError(f"{content['name']} has no tasks in the split {split}. It has: {there}.")
    repeated = sorted({t.id for t in tasks if sum(o.id == t.id for o in tasks) > 1})
    if repeated:
        raise InputError(f"{path} has more than one task {repeated[0]!r}; ids must differ.")
    return Suite(content["name"], " ".join(content["description"].split()), tasks)


def description(name: str) -> str:
    """Return a shipped suite's own description."""
    content = yaml.safe_load((HERE / f"{name}.yaml").read_text(encoding="utf-8"))
    return " ".join(content["description"].split())


def write_suite(folder: Path, name: str) -> Path:
    """Make a suite of a folder in the photos' format; return the path of its YAML file.

    Raises:
        InputError: it has one already, its annotations.json cannot be read, or annotations do not
            fit their pictures.
    """
    path = folder / FILE
    for entry in read_entries(folder / ANNOTATIONS):
        check_frame(entry, folder)
    if path.exists():
        raise InputError(f"{path} is there already; remove it to make it anew.")
    content = annotated(folder / ANNOTATIONS, name)
    write_whole(path, yaml.safe_dump(content, sort_keys=False).encode())
    return path


def annotated(path: Path, name: str = "") -> Entry:
    """Return the content of the suite that a file in the photos' format is by itself.

    Args:
        path: of the file.
        name: of the suite; by default the folder's, or the file's if not annotations.json.
    """
    place = path.resolve()
    own = place.parent.name if path.name == ANNOTATIONS else place.stem
    called = re.sub(r"[^a-z0-9_-]+", "-", (name or own).lower()).strip("-_") or "mine"
    item = {"folder": ".", "family": called}
    return {
        "name": called,
        "description": f"Tasks on the pictures of {place.parent.name}.",
        "tasks": [item if path.name == ANNOTATIONS else item | {"file": path.name}],
    }


def schema() -> Entry:
    """Return the JSON Schema of suites."""
    return json.loads((HERE / "schema.json").read_text(encoding="utf-8"))


def seeds_of(value: str | list[int], path: Path) -> list[int]:
    """Return seeds as listed, or those of a range A-B.

    Raises:
        InputError: it is no such range.
    """
    if isinstance(value, list):
        return value
    match = re.fullmatch(r"([0-9]{1,9})(?:-([0-9]{1,9}))?", value)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
    if not first <= last < first + 10_000:
        raise InputError(f"{path}: seeds {value!r} are no range such as 0-199 of at most 10,000.")
    return list(range(first, last + 1))


def _suite_path(name: str) -> Path:
    if name in shipped():
        return HERE / f"{name}.yaml"
    path = Path(name)
    if path.is_dir():
        return path / (FILE if (path / FILE).exists() else ANNOTATIONS)
    return path


def _read_yaml(path: Path, name: str) -> Any:
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError:
        raise InputError(
            f"Unknown suite {name!r}. There are: {', '.join(shipped())}; or give a YAML file, or "
            f"a folder with an {ANNOTATIONS}."
        ) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not YAML: {' '.join(str(error).split())[:200]}.") from None


def _split_of(family: str, splits: dict[str, list[str]], path: Path) -> Split:
    """Return the split of a family; dev if the suite has no splits."""
    found: list[Split] = [s for s in SPLITS if family in splits.get(s, ())]
    if splits and len(found) != 1:
        raise InputError(
            f"{path}: the family {family!r} is in {len(found)} splits; every family of its tasks "
            "must be in one."
        )
    return found[0] if splits else "dev"


def _tasks_of_item(
    item: Entry, path: Path, splits: dict[str, list[str]], wanted: str | None
) -> Iterator[Task]:
    """Yield the tasks of one item of a suite's list; only those in the wanted split, if given."""
    if "dialogues" in item:
        yield from _dialogues(item, path, splits, wanted)
        return
    must, named = bool(item.get("must_pass")), item.get("photos", "all")
    scale = {name: item[name] for name in (SCALE,) if name in item}
    style = {name: item[name] for name in ("style",) if name in item}
    for make, family, root in _entries(item, path):
        split = _split_of(family, splits, path)
        if wanted not in (None, split):
            continue
        entry = make() | scale
        for task in entry["tasks"]:
            if named == "all" or task["id"] in named:
                yield task_of(entry, task | style, root, family=family, split=split, must_pass=must)


def _dialogues(
    item: Entry, path: Path, splits: dict[str, list[str]], wanted: str | None
) -> Iterator[Task]:
    """Yield the dialogues of an item as tasks, listed there or in a file of their own."""
    listed = dialogues_in(item, path)
    form = {"type": "array", "items": {"$ref": "#/$defs/dialogue"}, "$defs": schema()["$defs"]}
    check_format(listed, form, f"{path} breaks the format of dialogues")
    family = item.get("family", "dialogues")
    split = _split_of(family, splits, path)
    if wanted in (None, split):
        for given in listed:
            yield dialogue_task(given, item.get("category", family), split)


def _entries(item: Entry, path: Path) -> Iterator[tuple[Callable[[], Entry], str, Path]]:
    """Yield for each entry a function that makes it, its family, and the folder of its image."""
    if "scenes" in item:
        recipe = RECIPES[item.get("recipe", "own")]
        for seed in seeds_of(item["scenes"], path):
            family = item.get("family") or family_of(seed).name
            yield partial(recipe, seed, item.get(SCALE)), family, Path()
        return
    folder = PHOTOS if "photos" in item else path.parent / item.get("folder", "")
    source = path if "pictures" in item else folder / item.get("file", ANNOTATIONS)
    entries = read_entries(source, item.get("pictures"))
    known = {task["id"] for entry in entries for task in entry["tasks"]}
    named = item.get("photos", "all")
    missing = [] if named == "all" else [name for name in named if name not in known]
    if missing:
        raise InputError(f"{path}: there is no photograph's task {missing[0]!r}.")
    for entry in entries:
        yield partial(dict, entry), item.get("family") or entry.get("family", ""), source.parent
