"""Reading what a model that writes coordinates wrote: positions, or that none are to be placed."""

import json
from typing import Any, Literal

import numpy as np

Positions = tuple[tuple[float, float], ...]


def json_object(text: str) -> dict[str, Any]:
    """Return the last JSON object of a text, which may begin with thoughts; empty without one."""
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
    """Return the positions written as JSON; None if there are none that can be read."""
    try:
        pairs = np.asarray(json_object(text)["positions"], dtype=float)
    except (ValueError, KeyError, TypeError):
        return None
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.isfinite(pairs).all():
        return None
    return tuple((float(x), float(y)) for x, y in pairs)


def declined(text: str) -> Literal["question", "impossible"] | None:
    """Return whether placing no robot was a question or a refusal; None if it is neither."""
    written = json_object(text)
    if written.get("positions") != []:
        return None
    return "question" if written.get("question") else "impossible"
