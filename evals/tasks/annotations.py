"""The photographs' format: pictures with outlines, tasks and success rules, read and validated.

It is described in evals/photos/README.md and published as evals/photos/schema.json; any folder
with an annotations.json in it is a suite.
"""

import json
import re
from pathlib import Path
from typing import Any, cast

import jsonschema

from ...agent.report import Status
from ...tools.errors import InputError
from ...tools.perception.imports.masks import masks_in
from ...tools.store import read_bytes
from .task import Drawing, Goal, Split, Task, Thing

ANNOTATIONS = "annotations.json"
SCALE = "metres_per_pixel"
PHOTOS = Path(__file__).parents[1] / "photos"
"""The photographs that ship with formup."""
Entry = dict[str, Any]
DEPLOYED: tuple[Status, ...] = ("deployed",)


def read_entries(path: Path, entries: Any = None) -> list[Entry]:
    """Read and validate the entries of a file in the photos' format, or those given instead.

    Raises:
        InputError: no such file, not JSON, it breaks the schema, or a picture is missing.
    """
    try:
        entries = json.loads(path.read_text(encoding="utf-8-sig")) if entries is None else entries
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror or error}; give a folder with an {ANNOTATIONS}."
        ) from None
    except ValueError as error:
        raise InputError(f"{path} is not JSON: {error}.") from None
    schema = json.loads((PHOTOS / "schema.json").read_text(encoding="utf-8"))
    check_format(entries, schema, f"{path} breaks the photos format")
    for entry in entries:
        if not (path.parent / entry["image"]).is_file():
            raise InputError(f"{path} names {entry['image']}, which is not there.")
    return [entry | {"objects": _drawn_objects(entry, path.parent)} for entry in entries]


def _drawn_objects(entry: Entry, folder: Path) -> list[Entry]:
    """Return an entry's objects with their outlines, read from the mask files that they name."""
    size, picture = (entry["width"], entry["height"]), Path(entry["image"]).name
    found: list[Entry] = []
    for thing in entry["objects"]:
        if (file := thing.get("mask")) is not None:
            masks = masks_in(read_bytes(folder / file), file, size, picture)
            number = int(thing.get("thing", len(masks) == 1))
            if not 1 <= number <= len(masks):
                raise InputError(
                    f"{thing['id']} of {picture}: {file} holds {len(masks)} things; say which is "
                    f'meant, "thing": 1 to {len(masks)}.'
                )
            rings = masks[number - 1].mask.rings
            thing = thing | {"polygon": rings[0], "holes": rings[1:]}
        found.append(thing)
    return found


def check_format(content: Any, schema: Any, what: str) -> None:
    """Validate content against a JSON Schema.

    Raises:
        InputError: it breaks the schema; the text is `what` and the first three problems.
    """
    errors = jsonschema.Draft202012Validator(schema).iter_errors(content)
    problems = sorted(f"{error.json_path}: {error.message[:160]}" for error in errors)
    if problems:
        more = f" (and {len(problems) - 3} more)" if len(problems) > 3 else ""
        raise InputError(f"{what}: {'; '.join(problems[:3])}{more}.")


def task_of(
    entry: Entry, task: Entry, root: Path, *, family: str, split: Split, must_pass: bool
) -> Task:
    """Return a task of an entry.

    Args:
        entry: of a picture.
        task: one of its tasks.
        root: the folder its image is in; Path() for a drawn scene.
        family: of the picture.
        split: the one that the family is in.
        must_pass: whether it always succeeds.

    Raises:
        InputError: it names a thing that is not in the picture, or metres without a scale.
    """
    expects: tuple[Status, ...] = tuple(task.get("expects", DEPLOYED))
    drawn = re.fullmatch(r"scene_([0-9]{6,})\.png", entry["image"]) if root == Path() else None
    picture = (
        Drawing(int(drawn[1]), entry.get("inscription", "")) if drawn else root / entry["image"]
    )
    goals = task.get("goals", [task] if "deployed" in expects else [])
    return Task(
        id=task["id"],
        instruction=task["instruction"],
        robots=task["robots"],
        category=task["category"],
        setup=task["setup"],
        family=family,
        split=split,
        style=task.get("style", task.get("wording", "")),
        referring=task.get("referring", ""),
        goals=tuple(_goal_of(entry, task["id"], goal) for goal in goals),
        expects=expects,
        picture=picture,
        must_pass=must_pass,
        metres_per_pixel=entry.get(SCALE),
    )


def _goal_of(entry: Entry, task: str, goal: Entry) -> Goal:
    things = {
        o["id"]: Thing(o["id"], o["name"], o["polygon"], o.get("holes", []))
        for o in entry["objects"]
    }
    other = goal["success"].get("other")
    for name in filter(None, (goal["target"], other)):
        if name not in things:
            raise InputError(
                f"Task {task} names {name!r}, which is not among its picture's objects: "
                f"{', '.join(things)}."
            )
    return Goal(
        robots=goal["robots"],
        size=(entry["width"], entry["height"]),
        target=things[goal["target"]],
        success=_rule_in_pixels(goal["success"], task, entry.get(SCALE)),
        other=things[other] if other else None,
    )


def _rule_in_pixels(rule: Entry, task: str, scale: float | None) -> Entry:
    """Return a success rule with all lengths in px (`band_px` for `band_m`), as graders need it."""
    made: Entry = {}
    for name, value in rule.items():
        if not name.endswith("_m"):
            made[name] = value
            continue
        px = f"{name.removesuffix('_m')}_px"
        if scale is None or px in rule:
            why = f"its picture has no {SCALE}" if scale is None else f"also {px}"
            raise InputError(f"Task {task} has {name}, but {why}.")
        lengths = cast("list[Any]", value) if isinstance(value, list) else [value]
        scaled = [round(float(v) / scale, 2) for v in lengths]
        made[px] = scaled if isinstance(value, list) else scaled[0]
    return made
