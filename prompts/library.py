"""The lookup of prompts: the shipped ones, overlaid by those of the user's own folder.

An id in the user's folder hides the shipped id as a whole, with all its versions.
"""

from dataclasses import dataclass
from pathlib import Path

from .files import read_text
from .lock import Locked, read_lock
from .prompt import NAME, Prompt, PromptError, hash_of, parse_prompt

SHIPPED = Path(__file__).parent
PARTIALS, CURRENT, CHANGELOG = "partials", "CURRENT", "CHANGELOG.md"
_END = ".prompt.md"


@dataclass(frozen=True)
class PromptLibrary:
    """Prompts by name.

    Args:
        folder: the user's own folder; None for the shipped prompts alone.
    """

    folder: Path | None = None

    def ids(self) -> list[str]:
        """Return all ids, sorted.

        Raises:
            PromptError: the user's folder is not a directory.
        """
        if self.folder is not None and not self.folder.is_dir():
            raise PromptError(
                f"{self.folder} is no folder of prompts; `formup prompts new ID` makes one."
            )
        folders = [SHIPPED, *filter(None, [self.folder])]
        return sorted({id for folder in folders for id in ids_in(folder)})

    def names(self) -> list[str]:
        """Return all names, sorted by id: `id@draft-NAME` first, then `id@vNNN`."""
        return [name for id in self.ids() for name in names_in(self.home(id), id)]

    def home(self, id: str) -> Path:
        """Return the folder of prompts that an id is read from."""
        own = self.folder is not None and id in ids_in(self.folder)
        return self.folder if own and self.folder is not None else SHIPPED

    def path(self, name: str) -> Path:
        """Return the file of a prompt that is known to exist."""
        id, _, version = name.partition("@")
        return self.home(id) / id / f"{version}{_END}"

    def current(self, id: str) -> str:
        """Return the name of an id's current version, which its CURRENT file states.

        Raises:
            PromptError: there is no such id, or CURRENT does not name one of its versions.
        """
        if id not in self.ids():
            raise PromptError(f"Unknown prompt {id!r}. There are: {', '.join(self.names())}.")
        home = self.home(id)
        path = home / id / CURRENT
        name = f"{id}@{read_text(path).strip()}" if path.exists() else None
        if name is None or name not in names_in(home, id) or "@draft-" in name:
            what = "does not name a released version" if name else "is not there"
            raise PromptError(
                f"{path} {what}; name a version as {id}@v001, or make one current with "
                "`formup prompts promote`."
            )
        return name

    def resolve(self, name: str) -> str:
        """Return the full name of a prompt; an id alone stands for its current version.

        Raises:
            PromptError: there is no prompt of that name.
        """
        name = name if "@" in name else self.current(name)
        if name not in self.names():
            raise PromptError(f"Unknown prompt {name!r}. There are: {', '.join(self.names())}.")
        return name

    def load(self, name: str) -> Prompt:
        """Read a prompt.

        Args:
            name: `id@vNNN`, `id@draft-NAME`, or an id alone for its current version.

        Raises:
            PromptError: there is no prompt of that name, its file is not a valid prompt, or it
                is numbered as a version but was never released or was changed since.
        """
        name = self.resolve(name)
        home, path = self.home(name.partition("@")[0]), self.path(name)
        lock = read_lock(home)
        released = "@draft-" not in name
        if released and name not in lock:
            raise PromptError(
                f"{path} was never released: it is not in LOCK.json. If a release broke off, "
                "delete it and release the draft again; else take its version out, name it "
                f"draft-NAME{_END} and release that."
            )
        prompt = parse_prompt(name, read_text(path), lambda ref: read_partial(home, ref, lock))
        if released:
            _check_unchanged(prompt, lock[name], path)
        return prompt


def ids_in(folder: Path) -> list[str]:
    """Return the ids of the prompts of one folder, sorted."""
    found = {path.parent.name for path in folder.glob(f"*/*{_END}")} - {PARTIALS}
    return sorted(id for id in found if NAME.fullmatch(f"{id}@v001"))


def names_in(folder: Path, id: str) -> list[str]:
    """Return the names of an id's prompts in one folder, sorted."""
    tags = [path.name.removesuffix(_END) for path in (folder / id).glob(f"*{_END}")]
    return sorted(f"{id}@{t}" for t in tags if NAME.fullmatch(f"{id}@{t}"))


def read_partial(home: Path, ref: str, lock: dict[str, Locked]) -> str:
    """Return the text of a partial, stripped of surrounding white space.

    Raises:
        PromptError: its file cannot be read, or was changed after its release.
    """
    name, _, version = ref.partition("@")
    path = home / PARTIALS / name / f"{version}.md"
    source = read_text(path)
    locked = lock.get(f"{PARTIALS}/{ref}")
    if locked is not None and locked.file_sha256 != hash_of(source):
        raise PromptError(f"{path} was changed after a prompt with it was released; {_PUT_BACK}.")
    return source.strip()


_PUT_BACK = "put it back, and make a new version for the change"


def _check_unchanged(prompt: Prompt, locked: Locked, path: Path) -> None:
    if (locked.file_sha256, locked.sha256) != (prompt.file_sha256, prompt.sha256):
        raise PromptError(f"{path} was changed after it was released; {_PUT_BACK}.")
