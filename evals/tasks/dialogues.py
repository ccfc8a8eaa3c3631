"""Reader of dialogues in suites: a picture, things pointed at, and what is said turn by turn.

Each turn has its expected result beside its words: a kind (see grading/dialogue.py) and checks by
name (see grading/dialogue_checks.py).
"""

from functools import cache
from pathlib import Path
from typing import Any, cast

import shapely
import yaml

from ...tools.errors import InputError
from ..grading.dialogue import BACK, STATUSES
from ..grading.dialogue_checks import CHECKS
from ..scenes.stories import entry_of, story_of
from .annotations import ANNOTATIONS, PHOTOS, SCALE, Entry, read_entries
from .task import Dialogue, Drawing, Split, Task, Thing, Turn

TURN_KEYS = ("say", "expect", "point", BACK)


def dialogues_in(item: Entry, path: Path) -> list[Entry]:
    """Return the dialogues that an item of a suite lists, or those of the file that it names.

    Raises:
        InputError: the file cannot be read, or holds no list.
    """
    given: list[Entry] | str = item["dialogues"]
    if isinstance(given, list):
        return given
    source = path.parent / given
    try:
        listed: Any = yaml.safe_load(source.read_text(encoding="utf-8"))
    except (OSError, yaml.YAMLError, UnicodeDecodeError) as error:
        text = " ".join(str(error).split())[:200]
        raise InputError(f"{source} is no file of dialogues: {text}.") from None
    if not isinstance(listed, list):
        raise InputError(f"{source} is no list of dialogues.")
    return cast("list[Entry]", listed)


def dialogue_task(given: Entry, category: str, split: Split) -> Task:
    """Return a dialogue as a task.

    Raises:
        InputError: it names a picture, a thing, an expectation or a check that does not exist.
    """
    name = given["id"]
    photo = "photo" in given
    entry = _photo(name, given["photo"]) if photo else _scene(given["scene"])
    things = [_thing(name, entry, called) for called in given["point"]]
    start = len(things)
    turns = [_turn(name, entry, turn, things) for turn in given["turns"]]
    statuses = STATUSES[turns[-1].expect]
    picture = PHOTOS / entry["image"] if photo else Drawing(given["scene"])
    return Task(
        id=name,
        instruction=" / ".join(turn.words for turn in turns),
        robots=given.get("robots"),
        category=category,
        setup="photo" if photo else "drawn",
        family="photos" if photo else entry["family"],
        split=split,
        style=given.get("style", ""),
        referring="",
        goals=(),
        expects=statuses,
        picture=picture,
        metres_per_pixel=given.get(SCALE),
        dialogue=Dialogue(tuple(turns), tuple(things), start, (entry["width"], entry["height"])),
    )


def _turn(name: str, entry: Entry, given: Entry, things: list[Thing]) -> Turn:
    """Return a turn; a thing that it points at is added to `things` if it is new."""
    checks: dict[str, Any] = {key: value for key, value in given.items() if key not in TURN_KEYS}
    unknown = sorted(checks.keys() - CHECKS.keys())
    if unknown or given["expect"] not in STATUSES:
        what = unknown[0] if unknown else given["expect"]
        known = ", ".join((*STATUSES, *CHECKS))
        raise InputError(f"{name}: there is no {what!r}. There are: {known}.")
    if BACK in given:
        checks[BACK] = given[BACK]
    point = given.get("point")
    if isinstance(point, str):
        thing = _thing(name, entry, point)
        if thing not in things:
            things.append(thing)
        inner = shapely.get_coordinates(shapely.point_on_surface(thing.region))[0]
        point = inner.round(1).tolist()
    return Turn(given["say"], given["expect"], checks, point and (point[0], point[1]))


def _thing(name: str, entry: Entry, called: str) -> Thing:
    for o in entry["objects"]:
        if o["id"] == called:
            return Thing(o["id"], o["name"], o["polygon"], o.get("holes", []))
    known = ", ".join(o["id"] for o in entry["objects"])
    raise InputError(f"{name}: there is no {called!r} in its picture. There are: {known}.")


def _photo(name: str, called: str) -> Entry:
    entries = {Path(e["image"]).stem: e for e in read_entries(PHOTOS / ANNOTATIONS)}
    if called not in entries:
        raise InputError(f"{name}: there is no photograph {called!r}: {', '.join(entries)}.")
    return entries[called]


@cache
def _scene(seed: int) -> Entry:
    return entry_of(story_of(seed))
