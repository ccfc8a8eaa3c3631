"""Finds a checkpoint's folder: a local one, or one downloaded from Hugging Face and cached.

Only configurations, vocabularies and safetensors are fetched: none of them contains code.
"""

import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from ...errors import InputError

FILES = ("*.json", "*.txt", "*.model", "*.safetensors")
NEEDED = ("config.json", "*.safetensors")
REPOSITORY = re.compile(r"[\w.-]+/[\w.-]+(@[\w./-]+)?")
OFFLINE = (
    "Copy its folder here and name that instead, or run once with a network and without "
    "HF_HUB_OFFLINE"
)


def checkpoint_folder(name: str) -> Path:
    """Return the folder of a checkpoint, downloading it if it is not on this machine.

    Args:
        name: a folder, or OWNER/NAME or OWNER/NAME@REVISION on Hugging Face.

    Raises:
        InputError: there is no such checkpoint, or it cannot be downloaded.
    """
    folder = Path(name).expanduser()
    if folder.is_dir():
        if not _is_whole(folder):
            raise InputError(
                f"The folder {name} holds no checkpoint: it needs {' and '.join(NEEDED)}."
            )
        return folder
    if not REPOSITORY.fullmatch(name):
        raise InputError(
            f"There is no checkpoint {name!r}: give a folder that is there, or OWNER/NAME or "
            "OWNER/NAME@REVISION on Hugging Face."
        )
    repository, _, revision = name.partition("@")
    return _from_hub(repository, revision or None)


def _is_whole(folder: Path) -> bool:
    return all(any(folder.glob(pattern)) for pattern in NEEDED)


def _from_hub(repository: str, revision: str | None) -> Path:
    hub: Any = import_module("huggingface_hub")
    wanted: dict[str, Any] = {"revision": revision, "allow_patterns": [*FILES]}
    try:
        kept = Path(hub.snapshot_download(repository, local_files_only=True, **wanted))
        if _is_whole(kept):
            return kept
    except hub.errors.LocalEntryNotFoundError:
        pass
    try:
        files = hub.snapshot_download(repository, dry_run=True, **wanted)
        about = hub.HfApi().model_info(repository, revision=revision)
        sys.stderr.write(_notice(repository, files, about, hub.constants.ENDPOINT))
        return Path(hub.snapshot_download(repository, **wanted))
    except Exception as error:  # the hub's client, HTTP or the disk failed: the person has to act
        why = (str(error).strip() or type(error).__name__).splitlines()[0].rstrip(".")
        raise InputError(
            f"The checkpoint {repository} is not on this machine and cannot be downloaded "
            f"({type(error).__name__}: {why}). {OFFLINE}."
        ) from None


def _notice(repository: str, files: Any, about: Any, host: str) -> str:
    """Return the notice of what is about to be downloaded, for a person."""
    size = sum(file.file_size for file in files if file.will_download) / 1e6
    licence = getattr(about.card_data, "license", None) or "not stated"
    return f"Downloading {repository} once: {size:,.0f} MB from {host}, licence: {licence}.\n"
