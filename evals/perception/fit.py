"""Fit of the built-in segmenter's confidence to its cues: `python -m formup.evals.perception.fit`.

Logistic regression of whether a mask is right, with weights of 0 or more: no cue that is high
speaks against a mask. It prints, from fits that leave the picture out, how reliable it is.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from ...tools.geometry.outline import FloatArray
from ...tools.perception.segmenters import confidence
from ...tools.perception.segmenters.grabcut_segmenter import GrabCutSegmenter
from .samples import MODES, Mode, Sample, measured
from .tables import reliability

SUITES = ("photos", "photos-added")
CUES = {
    "point": ("stability", "agreement", "colour_separation", "prompt_fit", "unrivalled"),
    "box": ("stability", "agreement", "colour_separation", "prompt_fit", "compactness"),
    "outline": ("path_agreement", "agreement", "colour_separation", "prompt_fit", "compactness"),
}
RIDGE = 0.3
"""Strength of the ridge penalty on the weights."""


def fit_weights(cues: FloatArray, right: FloatArray) -> FloatArray:
    """Return the constant and the weights (k + 1,) of least loss.

    Args:
        cues: (n, k), 0 to 1.
        right: (n,), 0 or 1.
    """
    design = np.column_stack([np.ones(len(cues)), cues])

    def loss(weights: FloatArray) -> tuple[float, FloatArray]:
        total = design @ weights
        shrunk = RIDGE * np.r_[0, weights[1:]]
        cost = float(np.sum(np.logaddexp(0, total) - right * total) + shrunk @ weights / 2)
        return cost, design.T @ (1 / (1 + np.exp(-total)) - right) + shrunk

    bounds = [(None, None)] + [(0, None)] * cues.shape[1]
    start = np.zeros(design.shape[1])
    return np.asarray(minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x)


def held_out_likelihoods(
    samples: Sequence[Sample], cues: FloatArray, right: FloatArray
) -> FloatArray:
    """Return how likely each sample is right, (n,), from a fit without its picture."""
    pictures, likely = np.array([s.picture for s in samples]), np.zeros(len(samples))
    for picture in np.unique(pictures):
        out = pictures == picture
        constant, *weights = fit_weights(cues[~out], right[~out])
        likely[out] = 1 / (1 + np.exp(-(constant + cues[out] @ weights)))
    return likely


def fit(mode: Mode) -> dict[str, float]:
    """Return the weights of a way of pointing, and print how reliable the likelihoods are."""
    segmenter = GrabCutSegmenter()
    found = [s for suite in SUITES for s in measured(suite, mode, segmenter) if s.cues]
    cues = np.array([[s.cues.get(name, 1.0) for name in CUES[mode]] for s in found])
    right = np.array([float(s.overlap >= confidence.RIGHT) for s in found])
    for line in reliability(held_out_likelihoods(found, cues, right), right):
        print(mode, line)  # noqa: T201
    constant, *weights = (round(float(w), 3) for w in fit_weights(cues, right))
    return {"constant": constant, **dict(zip(CUES[mode], weights, strict=True))}


if __name__ == "__main__":
    made = {mode: fit(mode) for mode in MODES}
    path = Path(confidence.__file__).with_suffix(".json")
    path.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
