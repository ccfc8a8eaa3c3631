"""The store that an address means, and where sessions lie by default."""

import os
import sys
from pathlib import Path

from .folder_store import FolderStore
from .protocol import Store


def store_at(address: str | Path | None = None) -> Store:
    """Return the store at an address.

    Args:
        address: a folder, `sqlite:///FILE`, or `postgresql://USER:PASSWORD@HOST/DATABASE`; None
            for the database in the user's data folder.

    Raises:
        InputError: the address is none of these, or needs an extra that is not installed.
        StorageError: the store cannot be used.
    """
    if address is None:
        address = default_store()
    if "://" not in str(address):
        return FolderStore(Path(address))
    from .database import DatabaseStore  # its library takes a while to load

    return DatabaseStore(str(address))


def default_store() -> str:
    """Return the address of the database in the user's data folder."""
    return f"sqlite:///{data_folder() / 'sessions.db'}"


def data_folder() -> Path:
    """Return the folder for formup's data of a user, by the convention of the system."""
    home = Path.home()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData/Local")
    elif sys.platform == "darwin":
        base = home / "Library/Application Support"
    else:
        base = Path(os.environ.get("XDG_DATA_HOME") or home / ".local/share")
    return base / "formup"
