"""The history of prompts: how versions differ, when and why they were made, and from what."""

import difflib
import re
from dataclasses import dataclass

from .files import read_text
from .library import CHANGELOG, PromptLibrary
from .prompt import Prompt, PromptError, split_file

_ENTRY = re.compile(r"- ([0-9]{4}-[0-9]{2}-[0-9]{2}) (v[0-9]{3}) (released|current): (.+)")


@dataclass(frozen=True)
class Entry:
    """A line of a changelog: a version was released or became the current one.

    Attributes:
        on: the date, YYYY-MM-DD.
        name: `id@vNNN`.
        what: `released` or `current`.
        why: the reason given.
    """

    on: str
    name: str
    what: str
    why: str


def diff(old: Prompt, new: Prompt) -> list[str]:
    """Return two unified diffs as lines: of the front matter, and of the text with its partials."""
    lines: list[str] = []
    heads = [split_file(p.name, p.source)[0] for p in (old, new)]
    for what, before, after in (("front matter", *heads), ("text", old.text, new.text)):
        names = [f"{p.name} {what}" for p in (old, new)]
        texts = (before.splitlines(), after.splitlines())
        lines += difflib.unified_diff(*texts, names[0], names[1], lineterm="")
    return lines


def log(library: PromptLibrary, id: str) -> list[Entry]:
    """Return the entries of an id's changelog, oldest first, skipping any other lines.

    Raises:
        PromptError: there is no such id, or its changelog cannot be read.
    """
    if id not in library.ids():
        raise PromptError(f"Unknown prompt {id!r}. There are: {', '.join(library.ids())}.")
    path = library.home(id) / id / CHANGELOG
    lines = read_text(path).splitlines() if path.exists() else []
    found = [match.groups() for match in map(_ENTRY.fullmatch, lines) if match]
    return [Entry(on, f"{id}@{v}", what, why) for on, v, what, why in found]


def lineage(prompts: list[Prompt]) -> dict[str | None, list[str]]:
    """Group the names by parent; those whose parent is not among the prompts come under None.

    So does a prompt that is its own ancestor, which only editing by hand can bring about.
    """
    parents = {p.name: p.front.parent for p in prompts}
    children: dict[str | None, list[str]] = {}
    for name, parent in parents.items():
        known = parent in parents and not _circular(name, parents)
        children.setdefault(parent if known else None, []).append(name)
    return children


def _circular(name: str, parents: dict[str, str | None]) -> bool:
    seen: set[str] = set()
    at: str | None = name
    while at is not None and at not in seen:
        seen.add(at)
        at = parents.get(at)
    return at == name
