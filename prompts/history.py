"""What became of a prompt: how versions differ, when and why they were made, what came of what."""

import difflib
import re
from dataclasses import dataclass

from .files import read_text
from .library import CHANGELOG, PromptLibrary
from .prompt import Prompt, PromptError, split_file

_ENTRY = re.compile(r"- ([0-9]{4}-[0-9]{2}-[0-9]{2}) (v[0-9]{3}) (released|current): (.+)")


@dataclass(frozen=True)
class Entry:
    """A line of a changelog: a version was released, or became the current one."""

    on: str
    name: str
    what: str
    why: str


def diff(old: Prompt, new: Prompt) -> list[str]:
    """The lines of two unified diffs, of the front matter and of the text, partials put in."""
    lines: list[str] = []
    heads = [split_file(p.name, p.source)[0] for p in (old, new)]
    for what, before, after in (("front matter", *heads), ("text", old.text, new.text)):
        names = [f"{p.name} {what}" for p in (old, new)]
        texts = (before.splitlines(), after.splitlines())
        lines += difflib.unified_diff(*texts, names[0], names[1], lineterm="")
    return lines


def log(library: PromptLibrary, id: str) -> list[Entry]:
    """The entries of an id's changelog, oldest first; other lines of it are left out.

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
    """Names by the parent they were made from; under None those whose parent is not among them.

    A prompt that is its own forebear, which only a hand can write, is under None as well.
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
