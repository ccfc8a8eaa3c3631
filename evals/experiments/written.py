"""What a model wrote that writes coordinates itself: positions, or that none shall be placed."""

import json
from typing import Any, Literal

import numpy as np

Positions = tuple[tuple[float, float], ...]


def json_object(text: str) -> dict[str, Any]:
    """The last JSON object of a text, which may have thoughts before it; empty without one."""
    found: dict[str, Any] = {}
    start, decoder = text.find("{"), json.JSONDecoder()
    while start >= 0:
        try:
            found, end = decoder.raw_decode(text, start)
        except (ValueError, RecursionError):
            end = start + 1
        start = text.find("{", end)
    return found


def written_positions(text: str) -> Positions | None:
    """The positions written as JSON; None if there are none that can be read."""
    try:
        pairs = np.asarray(json_object(text)["positions"], dtype=float)
    except (ValueError, KeyError, TypeError):
        return None
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.isfinite(pairs).all():
        return None
    return tuple((float(x), float(y)) for x, y in pairs)


def declined(text: str) -> Literal["question", "impossible"] | None:
    """What has been done by writing that no robot shall be placed; else None."""
    written = json_object(text)
    if written.get("positions") != []:
        return None
    return "question" if written.get("question") else "impossible"
