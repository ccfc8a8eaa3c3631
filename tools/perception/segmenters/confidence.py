"""What a mask's cues come to: the share of such masks that were right where the truth was known.

The weights are fitted on photographs by `python -m formup.evals.perception.fit`.
"""

import json
import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Literal

Way = Literal["point", "box", "outline"]
"""How a thing was pointed at."""
RIGHT = 0.8
"""A mask is right whose overlap with the thing, intersection over union, is at least this."""
EDGES = "edge_support"
"""Photographs hold too few masks that end where there is no edge to fit what that means."""
EDGE_POWER = 2


def fitted_confidence(way: Way, cues: Mapping[str, float]) -> float:
    """How likely a mask is right, 0 to 1: logistic regression on its cues, and edges to it.

    Args:
        way: the thing was pointed at, each with weights of its own. Who draws an outline may mean
            an edge that the picture does not show.
        cues: in [0, 1] by name; one that is absent counts as 1, that nothing speaks against it.
    """
    weights = fitted_weights()[way]
    total = sum(w * cues.get(name, 1.0) for name, w in weights.items() if name != "constant")
    likely = 1 / (1 + math.exp(-(weights["constant"] + total)))
    return likely if way == "outline" else likely * cues.get(EDGES, 1.0) ** EDGE_POWER


@cache
def fitted_weights() -> dict[str, dict[str, float]]:
    """The weight of each cue, and the constant, by way of pointing."""
    return json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))
