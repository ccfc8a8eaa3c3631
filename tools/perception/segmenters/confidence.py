"""Combines a mask's cues into the share of such masks that were right where the truth is known.

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
"""Least overlap (intersection over union) with the thing for a mask to be right."""
EDGES = "edge_support"
"""Cue with a fixed effect: too few masks on photographs end where there is no edge to fit one."""
EDGE_POWER = 2


def fitted_confidence(way: Way, cues: Mapping[str, float]) -> float:
    """Return how likely a mask is right, 0 to 1.

    This is a logistic regression on its cues, times a power of its edge support, except for
    outlines: somebody who draws one may mean an edge that the picture does not show.

    Args:
        way: how the thing was pointed at; each way has weights of its own.
        cues: in [0, 1] by name; an absent one counts as 1, as nothing speaks against the mask.
    """
    weights = fitted_weights()[way]
    total = sum(w * cues.get(name, 1.0) for name, w in weights.items() if name != "constant")
    likely = 1 / (1 + math.exp(-(weights["constant"] + total)))
    return likely if way == "outline" else likely * cues.get(EDGES, 1.0) ** EDGE_POWER


@cache
def fitted_weights() -> dict[str, dict[str, float]]:
    """Return the weight of each cue, and the constant, by way of pointing."""
    return json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))
