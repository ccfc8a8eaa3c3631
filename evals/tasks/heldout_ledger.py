"""The ledger of looks at held-out tasks: each look is recorded before it is taken.

Looking often enough means fitting the held-out tasks; the ledger says how often it was done.
"""

import json
import time
from collections.abc import Sequence
from pathlib import Path

from ...tools.errors import InputError

NAME = "heldout-ledger.jsonl"


def look(folder: Path, suite: str, sha256: str, arms: Sequence[str]) -> int:
    """Record a look; return how many there have been at this split, this one included.

    Args:
        folder: of the ledger; the one that holds the folders of runs.
        suite: its name.
        sha256: of the split.
        arms: names of the arms that are tried on it.

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
