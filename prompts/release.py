"""The life of a prompt: from a draft to a released version, and on to the current one.

A release never overwrites a file; it is then entered in LOCK.json and CHANGELOG.md. Only one
process at a time writes in a folder.
"""

import re
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from datetime import date
from itertools import count
from pathlib import Path

from pydantic_core import to_json

from .files import locked_folder, read_text, write_new, write_whole
from .library import (
    CHANGELOG,
    CURRENT,
    PARTIALS,
    SHIPPED,
    PromptLibrary,
    names_in,
)
from .lock import NAME as LOCK
from .lock import Locked, read_lock
from .prompt import (
    DRAFT,
    ID,
    Prompt,
    PromptError,
    hash_of,
    parse_prompt,
    split_file,
    tag,
)

MAX_VERSION = 999
_TEMPLATE = """---
id: {id}
summary: What it is for, in one line.
---
Say here what the model is to do.
"""


def new_draft(library: PromptLibrary, name: str, parent: str | None = None) -> Path:
    """Create a draft in the user's folder, which is made if need be, and return its path.

    An id that only ships with formup is first copied there whole, so that its versions, its
    current one and the draft stand side by side.

    Args:
        library: one with a user's folder.
        name: an id, or `id@draft-NAME`.
        parent: the prompt to start from; None for the id's current version, or for an empty
            template if it has none.

    Raises:
        PromptError: the name is invalid or taken, there is no such parent, or the folder is
            missing or cannot be written.
    """
    id, _, draft = name.partition("@")
    if not re.fullmatch(ID, id) or id == PARTIALS or (draft and not re.fullmatch(DRAFT, draft)):
        raise PromptError(
            f"{name!r} is no name for a draft; give ID or ID@draft-NAME, of a-z, 0-9 and hyphens."
        )
    folder = _own_folder(library)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PromptError(f"{folder} cannot be made: {error.strerror or error}.") from None
    known = id in library.ids()
    released = known and any("@v" in name for name in names_in(library.home(id), id))
    source = library.load(parent or id) if parent or released else None
    with locked_folder(folder):
        if known and library.home(id) != folder:
            _copy_shipped(id, folder)
        (folder / id).mkdir(exist_ok=True)
        there = names_in(folder, id)
        draft = draft or next(d for n in count(1) if f"{id}@{(d := f'draft-{n}')}" not in there)
        text = _TEMPLATE.format(id=id)
        if source is not None:
            _copy_partials(library.home(source.id), source.front.include, folder)
            text = _draft_from(source, id)
        path = folder / id / f"{draft}.prompt.md"
        write_new(path, text)
    return path


def release(
    library: PromptLibrary, name: str, why: str, on: date, tools: Mapping[str, str] | None = None
) -> str:
    """Freeze a draft as the next version; the first of an id becomes current at once.

    Args:
        library: one with a user's folder.
        name: `id@draft-NAME`, in that folder.
        why: the reason, for the changelog.
        on: the date of the release.
        tools: hashes of the tools' schemas as they are now, by name.

    Returns:
        The name of the version.

    Raises:
        PromptError: it is not a draft in that folder, is not valid, or cannot be written; or
            `why` is empty.
    """
    folder, reason = _own_folder(library), _required_reason(why)
    id = name.partition("@")[0]
    with locked_folder(folder):
        draft = library.load(name)
        if isinstance(draft.version, int) or library.home(id) != folder:
            raise PromptError(f"{draft.name} is no draft in {folder}; only drafts are released.")
        numbers = [int(n[-3:]) for n in names_in(folder, id) if "@v" in n]
        number = max(numbers, default=0) + 1
        if number > MAX_VERSION:
            raise PromptError(f"{id} has {MAX_VERSION} versions; no more can be numbered.")
        version = f"{id}@{tag(number)}"
        text = _stamped(draft, number, on)
        lock = read_lock(folder)
        frozen = parse_prompt(version, text, lambda ref: _freeze(folder, ref, lock))
        lock[version] = Locked(
            sha256=frozen.sha256, file_sha256=frozen.file_sha256, tools=dict(tools or {})
        )
        _publish(library, frozen, lock, f"- {on} {tag(number)} released: {reason}")
        if not numbers:
            _append_changelog(folder / id, f"- {on} {tag(number)} current: the first version")
            write_whole(folder / id / CURRENT, f"{tag(number)}\n")
        library.path(name).unlink()
    return version


def promote(library: PromptLibrary, name: str, because: str, on: date, after: str | None) -> None:
    """Make a released version the current one.

    Args:
        library: one with a user's folder.
        name: `id@vNNN`, in that folder.
        because: the reason, for the changelog: what it was compared on, or why it was not.
        on: the date.
        after: the version it was compared with, which must still be the current one; None if
            it was not compared.

    Raises:
        PromptError: it is not released or not in that folder, is already current, or another
            has become current meanwhile; or `because` is empty.
    """
    folder, reason = _own_folder(library), _required_reason(because)
    prompt = library.load(name)
    if not isinstance(prompt.version, int):
        raise PromptError(f"{prompt.name} is a draft and cannot be current; release it first.")
    home = folder / prompt.id
    if library.home(prompt.id) != folder:
        raise PromptError(
            f"{prompt.name} is not in {folder}: `formup prompts new {prompt.id}` copies it there."
        )
    with locked_folder(folder):
        now = read_text(home / CURRENT).strip() if (home / CURRENT).exists() else None
        if now == tag(prompt.version):
            raise PromptError(f"{prompt.name} is the current version already.")
        if after is not None and after != f"{prompt.id}@{now}":
            raise PromptError(f"{after} is no longer current but {now}; compare with that.")
        _append_changelog(home, f"- {on} {tag(prompt.version)} current: {reason}")
        write_whole(home / CURRENT, f"{tag(prompt.version)}\n")


def _own_folder(library: PromptLibrary) -> Path:
    """Return the user's folder; raise PromptError if there is none or it may not be written."""
    if library.folder is None:
        raise PromptError(
            "The prompts that ship with formup stay as they are; name a folder of your own with "
            "--prompts DIR or FORMUP_PROMPTS."
        )
    checkout = (SHIPPED.parent / "pyproject.toml").is_file()
    if library.folder.resolve() == SHIPPED.resolve() and not checkout:
        raise PromptError(f"{library.folder} is of the installed formup and stays as it is.")
    return library.folder


def _copy_shipped(id: str, folder: Path) -> None:
    """Copy a shipped id to the folder: its released versions, partials and locks."""
    names = [n for n in names_in(SHIPPED, id) if "@v" in n]
    shipped, lock = read_lock(SHIPPED), read_lock(folder)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".copying.") as scratch:
        made = Path(scratch) / id
        shutil.copytree(SHIPPED / id, made, ignore=shutil.ignore_patterns("draft-*", ".*"))
        for name in names:
            _copy_partials(SHIPPED, PromptLibrary().load(name).front.include, folder)
        _write_lock(folder, lock | {name: shipped[name] for name in names})
        made.rename(folder / id)


def _copy_partials(home: Path, refs: Iterable[str], folder: Path) -> None:
    """Copy the partials that are missing; they are locked when a prompt with them is released."""
    for ref in refs:
        name, _, version = ref.partition("@")
        place = Path(PARTIALS) / name / f"{version}.md"
        if not (folder / place).exists():
            (folder / place).parent.mkdir(parents=True, exist_ok=True)
            write_new(folder / place, read_text(home / place))


def _draft_from(source: Prompt, id: str) -> str:
    """Return the source of a draft that starts from a prompt."""
    front, body = split_file(source.name, source.source)
    front = _drop_keys(front, "id", "version", "parent", "hypothesis", "created")
    parent = f"parent: {source.name}\n" if isinstance(source.version, int) else ""
    return f"---\nid: {id}\n{parent}hypothesis:\n{front}---\n{body}"


def _stamped(draft: Prompt, number: int, on: date) -> str:
    """Return the source of a draft rewritten as that of a version."""
    front, body = split_file(draft.name, draft.source)
    rest = _drop_keys(front, "id", "version", "created")
    return f"---\nid: {draft.id}\nversion: {number}\ncreated: {on}\n{rest}---\n{body}"


def _drop_keys(front: str, *keys: str) -> str:
    """Return the front matter without the keys and what is indented below them."""
    return re.sub(rf"^({'|'.join(keys)}):.*\n(?:[ \t].*\n|\n)*", "", front, flags=re.MULTILINE)


def _freeze(folder: Path, ref: str, lock: dict[str, Locked]) -> str:
    """Lock a partial, unless it is locked already, and return its text."""
    name, _, version = ref.partition("@")
    source = read_text(folder / PARTIALS / name / f"{version}.md")
    locked = Locked(sha256=hash_of(source.strip()), file_sha256=hash_of(source))
    lock.setdefault(f"{PARTIALS}/{ref}", locked)
    return source.strip()


def _publish(library: PromptLibrary, prompt: Prompt, lock: dict[str, Locked], entry: str) -> None:
    """Write a version, then LOCK.json and the changelog; if LOCK.json fails, delete the version."""
    path, folder = library.path(prompt.name), library.home(prompt.id)
    write_new(path, prompt.source)
    try:
        _write_lock(folder, lock)
    except BaseException:
        path.unlink()
        raise
    _append_changelog(folder / prompt.id, entry)


def _write_lock(folder: Path, lock: Mapping[str, Locked]) -> None:
    facts = {name: lock[name].model_dump(exclude_defaults=True) for name in sorted(lock)}
    write_whole(folder / LOCK, to_json(facts, indent=1).decode() + "\n")


def _append_changelog(home: Path, entry: str) -> None:
    path = home / CHANGELOG
    before = read_text(path) if path.exists() else f"# {home.name}\n\n"
    gap = "\n" if "\n- " in before else "\n\n"
    write_whole(path, f"{before.rstrip()}{gap}{entry}\n")


def _required_reason(text: str) -> str:
    reason = " ".join(text.split())
    if not reason:
        raise PromptError('Say why, for the changelog: --why "...".')
    return reason
