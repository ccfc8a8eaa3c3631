"""Where prompts are found: those shipped and, on top, those of a folder of one's own.

An id in one's own folder stands for itself as a whole: no version of it is taken from elsewhere.
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
        folder: one's own; None for the shipped prompts alone.
    """

    folder: Path | None = None

    def ids(self) -> list[str]:
        """All ids, sorted.

        Raises:
            PromptError: one's own folder is none.
        """
        if self.folder is not None and not self.folder.is_dir():
            raise PromptError(
                f"{self.folder} is no folder of prompts; `formup prompts new ID` makes one."
            )
        folders = [SHIPPED, *filter(None, [self.folder])]
        return sorted({id for folder in folders for id in ids_in(folder)})

    def names(self) -> list[str]:
        """All names, sorted: `id@vNNN`, and `id@draft-NAME` before them."""
        return [name for id in self.ids() for name in names_in(self.home(id), id)]

    def home(self, id: str) -> Path:
        """The folder of prompts that an id is taken from."""
        own = self.folder is not None and id in ids_in(self.folder)
        return self.folder if own and self.folder is not None else SHIPPED

    def path(self, name: str) -> Path:
        """The file of a name that is known."""
        id, _, version = name.partition("@")
        return self.home(id) / id / f"{version}{_END}"

    def current(self, id: str) -> str:
        """The name of the version that an id alone stands for, which its CURRENT names.

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
        """The full name of a prompt, which an id alone gives for its current version.

        Raises:
            PromptError: there is none of that name.
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
            PromptError: there is none of that name, it is no prompt, or it was released and is
                not what it was then.
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
    """Ids of the prompts of one folder."""
    found = {path.parent.name for path in folder.glob(f"*/*{_END}")} - {PARTIALS}
    return sorted(id for id in found if NAME.fullmatch(f"{id}@v001"))


def names_in(folder: Path, id: str) -> list[str]:
    """Names of the prompts of an id in one folder, sorted."""
    tags = [path.name.removesuffix(_END) for path in (folder / id).glob(f"*{_END}")]
    return sorted(f"{id}@{t}" for t in tags if NAME.fullmatch(f"{id}@{t}"))


def read_partial(home: Path, ref: str, lock: dict[str, Locked]) -> str:
    """The text of a partial, without the blank lines around it.

    Raises:
        PromptError: it is not there, or was released and is not what it was then.
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
