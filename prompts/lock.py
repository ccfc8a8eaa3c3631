"""LOCK.json: the hashes of everything released in a folder of prompts, to detect later changes."""

from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, RootModel, ValidationError

from .files import read_text
from .prompt import PromptError

NAME = "LOCK.json"


class Locked(BaseModel):
    """The lock of one released prompt or partial.

    Attributes:
        sha256: hash of the text, partials inserted.
        file_sha256: hash of the file, with line ends as LF.
        tools: hash of each tool's schema at the release, by name; empty if none were stored.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    sha256: str
    file_sha256: str
    tools: Mapping[str, str] = {}


class _Lock(RootModel[dict[str, Locked]]):
    pass


def read_lock(folder: Path) -> dict[str, Locked]:
    """Return a folder's locks: of prompts by `id@vNNN`, of partials by `partials/name@vNNN`.

    Raises:
        PromptError: LOCK.json cannot be read, or is damaged.
    """
    path = folder / NAME
    if not path.exists():
        return {}
    try:
        return _Lock.model_validate_json(read_text(path)).root
    except ValidationError:
        raise PromptError(f"{path} is damaged; put it back as it was released.") from None
