"""Training of the model that reads instructions: its tags, its meanings, and its known words."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.sparse import csr_matrix

from ...agent.offline.tagging import (
    ANY,
    LABELS,
    MEANING_BUCKETS,
    MEANINGS,
    TAG_BUCKETS,
    LinearModel,
    meaning_features,
    stem,
    tag_features,
)
from .sentences import Sentence

PENALTY_TAGS, PENALTY_MEANINGS = 0.5, 0.3
"""Ridge penalties, chosen by leaving one author out."""
STEPS = 60
GENERAL = 5
"""A word with at least so many meanings, of ten, is taken to go with any."""
Floats = NDArray[np.float64]


def train(sentences: Sequence[Sentence]) -> LinearModel:
    """Return the model that fits the sentences best."""
    emission, transition = _train_tags(sentences)
    command = _train_meanings(sentences)
    return LinearModel(emission, transition, command)


def _feature_rows(features: Sequence[Sequence[int]], buckets: int) -> csr_matrix:
    """Return counts of features, (N, buckets)."""
    ends = np.cumsum([0, *(len(f) for f in features)])
    columns = np.concatenate([np.asarray(f) for f in features])
    return csr_matrix((np.ones(len(columns)), columns, ends), shape=(len(features), buckets))


def _train_meanings(sentences: Sequence[Sentence]) -> Floats:
    rows = _feature_rows(
        [meaning_features([w.text for w in s.words], s.labels) for s in sentences], MEANING_BUCKETS
    )
    truth = np.eye(len(MEANINGS))[[MEANINGS.index(s.meaning) for s in sentences]]

    def loss(flat: Floats) -> tuple[float, Floats]:
        weights = flat.reshape(MEANING_BUCKETS, -1)
        scores = rows @ weights
        norms = np.logaddexp.reduce(scores, axis=1)
        value = norms.sum() - (scores * truth).sum() + PENALTY_MEANINGS / 2 * (flat**2).sum()
        slope = rows.T @ (np.exp(scores - norms[:, None]) - truth) + PENALTY_MEANINGS * weights
        return float(value), slope.ravel()

    return _minimum(loss, MEANING_BUCKETS * len(MEANINGS)).reshape(MEANING_BUCKETS, -1)


def _train_tags(sentences: Sequence[Sentence]) -> tuple[Floats, Floats]:
    """Return the emission and transition weights of the conditional random field."""
    lines = [[w.text for w in s.words] for s in sentences]
    rows = _feature_rows([row for line in lines for row in tag_features(line)], TAG_BUCKETS)
    lengths = np.array([len(line) for line in lines])
    truth = np.array([LABELS.index(label) for s in sentences for label in s.labels])
    states = len(LABELS)
    follows = np.ones(len(truth) - 1, bool)
    follows[np.cumsum(lengths)[:-1] - 1] = False
    pairs = np.zeros((states, states))
    np.add.at(pairs, (truth[:-1][follows], truth[1:][follows]), 1)
    onehot = np.eye(states)[truth]

    def loss(flat: Floats) -> tuple[float, Floats]:
        emission = flat[: TAG_BUCKETS * states].reshape(TAG_BUCKETS, states)
        transition = flat[TAG_BUCKETS * states :].reshape(states, states)
        scores = rows @ emission
        norm, marginal, joint = _expectations(scores, lengths, transition)
        value = norm - (scores * onehot).sum() - (transition * pairs).sum()
        value += PENALTY_TAGS / 2 * (flat**2).sum()
        slope = np.concatenate([(rows.T @ (marginal - onehot)).ravel(), (joint - pairs).ravel()])
        return float(value), slope + PENALTY_TAGS * flat

    flat = _minimum(loss, TAG_BUCKETS * states + states**2)
    return (
        flat[: TAG_BUCKETS * states].reshape(TAG_BUCKETS, states),
        flat[TAG_BUCKETS * states :].reshape(states, states),
    )


def _expectations(
    scores: Floats, lengths: NDArray[np.intp], transition: Floats
) -> tuple[float, Floats, Floats]:
    """Return the log partition sum of all lines, label marginals (N, L), expected pairs (L, L)."""
    longest, states = int(lengths.max()), scores.shape[1]
    inside = np.arange(longest)[None, :] < lengths[:, None]
    padded = np.zeros((len(lengths), longest, states))
    padded[inside] = scores
    forward, backward = padded.copy(), np.zeros_like(padded)
    for i in range(1, longest):
        step = np.logaddexp.reduce(forward[:, i - 1, :, None] + transition, axis=1)
        forward[:, i] = np.where(inside[:, i, None], step + padded[:, i], forward[:, i - 1])
    for i in range(longest - 2, -1, -1):
        step = np.logaddexp.reduce(
            transition + (padded[:, i + 1] + backward[:, i + 1])[:, None, :], axis=2
        )
        backward[:, i] = np.where(inside[:, i + 1, None], step, 0.0)
    norm = np.logaddexp.reduce(forward[:, -1], axis=1)
    marginal = np.exp(forward + backward - norm[:, None, None])[inside]
    both = inside[:, 1:, None, None]
    joint = forward[:, :-1, :, None] + transition + (padded + backward)[:, 1:, None, :]
    joint = np.where(both, np.exp(joint - norm[:, None, None, None]), 0.0).sum(axis=(0, 1))
    return float(norm.sum()), marginal, joint


def _minimum(loss: Callable[[Floats], tuple[float, Floats]], size: int) -> Floats:
    found = minimize(loss, np.zeros(size), jac=True, method="L-BFGS-B", options={"maxiter": STEPS})
    return np.asarray(found.x)


def known_words(sentences: Sequence[Sentence]) -> dict[str, frozenset[str]]:
    """Return stems of words in commands, each with the meanings it had in two sentences or more.

    A word that occurred in commands of many meanings says nothing about them and goes with all.
    """
    counted: dict[str, Counter[str]] = {}
    for s in sentences:
        words = [w.text for w, name in zip(s.words, s.labels, strict=True) if name == "command"]
        for word in {stem(w) for w in words}:
            counted.setdefault(word, Counter())[s.meaning] += 1
    found: dict[str, frozenset[str]] = {}
    for word, meanings in counted.items():
        often = [m for m, count in meanings.items() if count > 1]
        if len(meanings) >= GENERAL:
            often.append(ANY)
        if often and word[0].isalpha():
            found[word] = frozenset(often)
    return found


def store(path: Path, model: LinearModel) -> None:
    """Write a model, with its weights rounded to 127 steps each way."""
    words = [" ".join([word, *sorted(meanings)]) for word, meanings in sorted(model.words.items())]
    arrays: dict[str, Any] = {"temperature": model.temperature, "words": np.array(words)}
    for name in ("emission", "transition", "command"):
        weights = getattr(model, name)
        step = float(np.abs(weights).max()) / 127
        arrays |= {name: np.round(weights / step).astype(np.int8), f"{name}_step": step}
    np.savez_compressed(path, **arrays)
