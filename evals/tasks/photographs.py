"""Suites of photographs: pictures with outlines, tasks and success rules, read and validated.

The format is described in evals/photos/README.md and published as evals/photos/schema.json;
any folder with an annotations.json in it is a suite.
"""

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import jsonschema

from ...tools.errors import InputError
from ...tools.geometry.outline import Outline, make_outline

Ring = list[list[float]]


@dataclass(frozen=True)
class Thing:
    """An annotated object: its name and outline, pixels of the stored image."""

    id: str
    name: str
    polygon: Ring
    holes: list[Ring]

    @cached_property
    def outline(self) -> Outline:
        """The outline as geometry."""
        return make_outline(self.polygon, tuple(self.holes))


@dataclass(frozen=True)
class Task:
    """One instruction on one photograph with the rule that says when it is done."""

    id: str
    instruction: str
    robots: int
    category: str
    setup: str
    image: Path
    size: tuple[int, int]
    target: Thing
    success: dict[str, Any] = field(repr=False)
    other: Thing | None = None
    referring: str = ""
    wording: str = ""
    metres_per_pixel: float | None = None


def photos_folder() -> Path:
    """The photographs that ship with formup."""
    return Path(__file__).parents[1] / "photos"


def load_tasks(folder: Path | None = None) -> list[Task]:
    """All tasks of a folder of photographs, in file order.

    Args:
        folder: holds annotations.json and the images it names, or is such a file by another name;
            None for the shipped ones.

    Raises:
        InputError: no such file, not JSON, against the schema, or a picture or target missing.
    """
    path = folder or photos_folder()
    path = path if path.suffix == ".json" else path / "annotations.json"
    return [task for entry in read_entries(path) for task in _tasks(entry, path.parent)]


def read_entries(path: Path, entries: Any = None) -> list[dict[str, Any]]:
    """The entries of a file in the photos' format, or those given as if they stood in it.

    Raises:
        InputError: no such file, not JSON, against the schema, or a picture missing.
    """
    try:
        entries = json.loads(path.read_text(encoding="utf-8")) if entries is None else entries
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror or error}; --data takes a folder with an annotations.json."
        ) from None
    except ValueError as error:
        raise InputError(f"{path} is not JSON: {error}.") from None
    _validate(entries, path)
    for entry in entries:
        if not (path.parent / entry["image"]).is_file():
            raise InputError(f"{path} names {entry['image']}, which is not there.")
    return entries


def rule_in_pixels(entry: dict[str, Any], task: dict[str, Any], rule: Any) -> dict[str, Any]:
    """A success rule with its lengths in px, `band_px` for `band_m`, which is what is graded.

    Args:
        entry: of the picture, with its `metres_per_pixel` if it has any.
        task: that the rule is of.
        rule: as written.

    Raises:
        InputError: a length in metres on a picture without a scale, or twice.
    """
    scale: float | None = entry.get("metres_per_pixel")
    made = dict[str, Any]()
    for name, value in rule.items():
        if not name.endswith("_m"):
            made[name] = value
            continue
        px = f"{name.removesuffix('_m')}_px"
        if scale is None or px in rule:
            why = "its picture has no metres_per_pixel" if scale is None else f"also {px}"
            raise InputError(f"Task {task['id']} has {name}, but {why}.")
        made[px] = _scaled(value, scale)
    return made


def _scaled(length: Any, scale: float) -> Any:
    """A length in metres, or a list of them, in px."""
    lengths = cast("list[Any]", length) if isinstance(length, list) else [length]
    px = [round(float(v) / scale, 2) for v in lengths]
    return px if isinstance(length, list) else px[0]


def _validate(entries: Any, path: Path) -> None:
    schema = json.loads((photos_folder() / "schema.json").read_text(encoding="utf-8"))
    validator = jsonschema.Draft202012Validator(schema)
    problems = [
        f"{error.json_path}: {error.message[:120]}"
        for error in sorted(validator.iter_errors(entries), key=lambda e: e.json_path)
    ]
    if problems:
        more = f" (and {len(problems) - 3} more)" if len(problems) > 3 else ""
        raise InputError(f"{path} breaks the photos format: {'; '.join(problems[:3])}{more}.")


def _tasks(entry: dict[str, Any], root: Path) -> list[Task]:
    things = {
        o["id"]: Thing(o["id"], o["name"], o["polygon"], o.get("holes", []))
        for o in entry["objects"]
    }
    tasks: list[Task] = []
    for task in entry["tasks"]:
        if "expects" in task:
            continue  # asking or refusing is right: of suites alone
        named = [task["target"], *filter(None, [task["success"].get("other")])]
        missing = [name for name in named if name not in things]
        if missing:
            raise InputError(
                f"Task {task['id']} names the target {missing[0]!r}, which is not "
                f"among its picture's objects: {', '.join(things)}."
            )
        tasks.append(
            Task(
                id=task["id"],
                instruction=task["instruction"],
                robots=task["robots"],
                category=task["category"],
                setup=task["setup"],
                image=root / entry["image"],
                size=(entry["width"], entry["height"]),
                target=things[task["target"]],
                success=rule_in_pixels(entry, task, task["success"]),
                other=things[named[1]] if len(named) > 1 else None,
                referring=task.get("referring", ""),
                wording=task.get("wording", ""),
                metres_per_pixel=entry.get("metres_per_pixel"),
            )
        )
    return tasks
