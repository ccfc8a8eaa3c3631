"""LOCK.json: the hashes of all that was released in a folder of prompts, so that it stays so."""

from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, RootModel, ValidationError

from .files import read_text
from .prompt import PromptError

NAME = "LOCK.json"


class Locked(BaseModel):
    """What was released.

    Attributes:
        sha256: of the text, its partials put in.
        file_sha256: of the file, line ends as LF.
        tools: hash of each tool's schema as it was then, by name; empty where none was kept.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    sha256: str
    file_sha256: str
    tools: Mapping[str, str] = {}


class _Lock(RootModel[dict[str, Locked]]):
    pass


def read_lock(folder: Path) -> dict[str, Locked]:
    """What was released in a folder: prompts as `id@vNNN`, partials as `partials/name@vNNN`.

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
