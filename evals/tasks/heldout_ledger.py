"""The ledger of looks at held-out tasks: each is written down before it is taken.

Whoever looks often enough fits what is held out; the ledger says how often that was.
"""

import json
import time
from collections.abc import Sequence
from pathlib import Path

from ...tools.errors import InputError

NAME = "heldout-ledger.jsonl"


def look(folder: Path, suite: str, sha256: str, arms: Sequence[str]) -> int:
    """Write a look down; how many there have been of this suite, this one included.

    Args:
        folder: of the ledger; the one that holds the folders of runs.
        suite: its name.
        sha256: of the split.
        arms: what looks.

    Raises:
        InputError: it cannot be written or read.
    """
    path = folder / NAME
    line = {"time": int(time.time()), "suite": suite, "sha256": sha256, "arms": list(arms)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        lines = path.read_text(encoding="utf-8").splitlines()
        return sum(json.loads(text)["sha256"] == sha256 for text in lines)
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path} cannot be used: {error}.") from None
