"""The role of each word of an instruction, by a small linear model trained on sentences.

It tells whether a word belongs to the command, to a phrase for a thing, to a further demand or to
the background, and which arrangement the command means, each with a probability. It is not a
language model: n-grams and weights in tagging.npz, made by `make wordings`.
"""

import re
import zlib
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from itertools import pairwise

import numpy as np
import yaml
from numpy.typing import NDArray

from .spans import trimmed

LABELS = ("command", "thing", "demand", "background")
DEMAND, SURE_DEMAND = LABELS.index("demand"), 0.5
"""Index of the label, and its least probability for a word to get it."""
MEANINGS = (
    *("around", "cage", "inside", "along", "corners", "between", "centre", "shape"),
    *("several", "ask"),
)
"""Arrangements that a command may mean; "ask" for none that can simply be carried out."""
ANY = "any"
"""Stands for all meanings, for words that occur in commands of most of them."""
TAG_BUCKETS, MEANING_BUCKETS = 1 << 16, 1 << 15
"""Numbers of buckets that features are hashed into, with one weight per label or meaning."""
TOKEN = re.compile(r"\d+(?:[.,]\d+)*|[^\W\d_]+(?:['\u2019][^\W\d_]+)*|[^\w\s]|_")
SENTENCE_ENDS = frozenset(".!?;\n")
ENDINGS = ("ing", "ed", "es", "s", "e")
LONGEST = 4
"""Most words of a phrase of classes.yaml that is looked for."""
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Token:
    """A word, a number in digits or a sign, lower case, and its position in the text."""

    text: str
    start: int
    end: int


def tokens(text: str) -> tuple[Token, ...]:
    """Return the words, numbers and signs of a text, in order."""
    found = TOKEN.finditer(text)
    return tuple(Token(m[0].lower().replace("\u2019", "'"), m.start(), m.end()) for m in found)


@dataclass(frozen=True)
class Tagging:
    """The roles of words, and the meaning of the command.

    Attributes:
        labels: one of LABELS for each token.
        certainty: the probability of each label, 0 to 1, before phrases for things are corrected.
        meaning: probabilities of the MEANINGS of the command.
    """

    labels: tuple[str, ...]
    certainty: tuple[float, ...]
    meaning: dict[str, float]


def tag(words: Sequence[Token], may_command: Sequence[bool] = ()) -> Tagging:
    """Return the most likely labels of an instruction's words, and the meaning of its command.

    Args:
        words: of the instruction.
        may_command: for each word whether it can belong to the command; by default all can.
    """
    model, texts = in_use(), [w.text for w in words]
    labels, certainty = model.labels(texts, may_command)
    labels = trimmed(texts, labels)
    return Tagging(labels, certainty, model.meaning(texts, labels))


@dataclass(frozen=True)
class LinearModel:
    """A linear-chain conditional random field over words, and a softmax over whole commands.

    Source: Lafferty, McCallum and Pereira 2001; hashed features, Weinberger et al. 2009.

    Attributes:
        emission: (TAG_BUCKETS, L) weights of features for labels.
        transition: (L, L) weights from a label to the next.
        command: (MEANING_BUCKETS, M) weights of features for meanings.
        temperature: divides the scores of meanings before the softmax, to calibrate it.
        words: stems of words that occurred in training commands, and the meanings of those.
    """

    emission: Floats
    transition: Floats
    command: Floats
    temperature: float = 1.0
    words: dict[str, frozenset[str]] = field(default_factory=dict[str, frozenset[str]])

    def labels(
        self, words: Sequence[str], may_command: Sequence[bool] = ()
    ) -> tuple[tuple[str, ...], tuple[float, ...]]:
        """Return each word's likeliest label, demands only if probable enough, and its probability.

        Args:
            words: of one instruction.
            may_command: for each word whether it can belong to the command; if empty, all can.
        """
        if not words:
            return (), ()
        scores = np.array([self.emission[row].sum(axis=0) for row in tag_features(words)])
        if may_command:
            scores[~np.asarray(may_command), LABELS.index("command")] = -np.inf
        marginal = _marginals(scores, self.transition)
        likely = marginal.copy()
        likely[marginal[:, DEMAND] < SURE_DEMAND, DEMAND] = 0
        best = likely.argmax(axis=1)
        chosen: list[int] = best.tolist()
        return tuple(LABELS[k] for k in chosen), tuple(
            marginal[range(len(chosen)), chosen].tolist()
        )

    def meaning(self, words: Sequence[str], labels: Sequence[str]) -> dict[str, float]:
        """Return the probabilities of MEANINGS."""
        scores = self.command[meaning_features(words, labels)].sum(axis=0) / self.temperature
        shares = np.exp(scores - scores.max())
        return dict(zip(MEANINGS, (shares / shares.sum()).tolist(), strict=True))


def _marginals(scores: Floats, transition: Floats) -> Floats:
    """Return marginal probabilities (N, L) of labels by the forward-backward algorithm."""
    forward, backward = scores.copy(), np.zeros_like(scores)
    for i in range(1, len(scores)):
        forward[i] += np.logaddexp.reduce(forward[i - 1][:, None] + transition, axis=0)
    for i in range(len(scores) - 2, -1, -1):
        backward[i] = np.logaddexp.reduce(
            transition + (scores[i + 1] + backward[i + 1])[None, :], axis=1
        )
    joint = forward + backward
    return np.exp(joint - np.logaddexp.reduce(joint, axis=1, keepdims=True))


_lent: ContextVar[LinearModel | None] = ContextVar("lent", default=None)


@contextmanager
def lent(model: LinearModel) -> Generator[None]:
    """Read with another model than the shipped one, to judge it."""
    token = _lent.set(model)
    try:
        yield
    finally:
        _lent.reset(token)


def in_use() -> LinearModel:
    """Return the model that reads: the one lent, else the shipped one."""
    return _lent.get() or shipped()


@cache
def shipped() -> LinearModel:
    """Load the model from tagging.npz, where each array is stored as whole numbers and a step."""
    with resources.files(__package__ or "").joinpath("tagging.npz").open("rb") as file:
        stored = dict(np.load(file))
    emission, transition, command = (
        stored[name] * float(stored[f"{name}_step"])
        for name in ("emission", "transition", "command")
    )
    rows = (str(row).split() for row in stored["words"])
    words = {word: frozenset(meanings) for word, *meanings in rows}
    return LinearModel(emission, transition, command, float(stored["temperature"]), words)


def tag_features(words: Sequence[str]) -> list[list[int]]:
    """Return the hashed features of each word, from its neighbourhood and its clause."""
    plain = ["#" if w[0].isdigit() else w for w in words]
    around = ["<", "<", *plain, ">", ">"]
    opening, classes = _clauses(plain), [(), *word_classes(words), ()]
    rows: list[list[int]] = []
    for i, word in enumerate(plain):
        before2, before, _, after, after2 = around[i : i + 5]
        clause = opening[i]
        names = (
            *("bias", f"w={word}", f"-1={before}", f"+1={after}", f"-2={before2}", f"+2={after2}"),
            *(f"-1,0={before} {word}", f"0,1={word} {after}", f"-2,-1={before2} {before}"),
            *(f"1,2={after} {after2}", f"-1,1={before} {after}", f"<{word[:3]}", f"<{word[:4]}"),
            *(f"{word[-2:]}>", f"{word[-3:]}>", f"c={clause[0]}", f"cc={clause[0]} {clause[1]}"),
            *(f"s={clause[2]}", f"c,w={clause[0]} {word}", f"p={clause[3]}", f"r={clause[4]}"),
        )
        named = [f"{k}:{c}" for k in (-1, 0, 1) for c in classes[i + 1 + k]]
        rows.append([_bucket(name, TAG_BUCKETS) for name in (*names, *named)])
    return rows


def word_classes(words: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the classes of classes.yaml of each word, alone or in a longer phrase."""
    stems = [stem(w) for w in words]
    found: list[set[str]] = [set() for _ in words]
    for start in range(len(words)):
        for length in range(min(LONGEST, len(words) - start), 0, -1):
            kinds = _classes().get(tuple(stems[start : start + length]), ())
            for k in range(start, start + length):
                found[k].update(kinds)
            if kinds:
                break
    return [tuple(sorted(kinds)) for kinds in found]


@cache
def _classes() -> dict[tuple[str, ...], tuple[str, ...]]:
    text = resources.files(__package__ or "").joinpath("classes.yaml").read_text("utf-8")
    found: dict[tuple[str, ...], tuple[str, ...]] = {}
    for kind, phrases in yaml.load(text, yaml.CSafeLoader).items():
        for phrase in phrases:
            stems = tuple(stem(w.text) for w in tokens(phrase))
            found[stems] = tuple(dict.fromkeys((*found.get(stems, ()), kind)))
    return found


def stem(word: str) -> str:
    """Return a word without its inflectional ending."""
    return next(
        (word[: -len(e)] for e in ENDINGS if word.endswith(e) and len(word) - len(e) >= 3), word
    )


def _clauses(words: Sequence[str]) -> list[tuple[str, str, str, str, str]]:
    """Return for each word the first two words of its clause, and the first of its sentence.

    Two more texts say whether the clause is first and last, and whether it contains a number.
    """
    bounds = [
        0,
        *(i + 1 for i, w in enumerate(words) if w in SENTENCE_ENDS or w in ",:-"),
        len(words),
    ]
    found: list[tuple[str, str, str, str, str]] = []
    sentence = "<"
    for start, end in pairwise(bounds):
        clause = words[start:end]
        if not clause:
            continue
        if start == 0 or words[start - 1] in SENTENCE_ENDS:
            sentence = clause[0]
        place = f"{start == 0}{end == len(words)}"
        counts = str("#" in clause)
        second = clause[1] if len(clause) > 1 else ">"
        found += [(clause[0], second, sentence, place, counts)] * len(clause)
    return found


def meaning_features(words: Sequence[str], labels: Sequence[str]) -> list[int]:
    """Return hashed n-grams of all but phrases for things, with and without the background."""
    names: list[str] = ["bias"]
    for kinds, label in zip(word_classes(words), labels, strict=True):
        names += [f"{label}:{kind}" for kind in kinds]
    for kept in (("command", "demand"), ("command", "demand", "background")):
        line: list[str] = []
        for word, label in zip(words, labels, strict=True):
            if label == "thing":
                line += [] if line[-1:] == ["_"] else ["_"]
            elif label in kept:
                line.append("#" if word[0].isdigit() else word)
            elif line[-1:] != ["|"]:
                line.append("|")
        mark = len(kept)
        names += [f"{mark}{w}" for w in line]
        names += [f"{mark}{a} {b}" for a, b in pairwise(line)]
        names += [f"{mark}{a} {b} {c}" for a, b, c in zip(line, line[1:], line[2:], strict=False)]
        if mark == 2:
            names += [f"<{w[:k]}" for w in line for k in (3, 4, 5) if len(w) > k]
            names += [f"{w[-k:]}>" for w in line for k in (3, 4) if len(w) > k]
    return [_bucket(name, MEANING_BUCKETS) for name in dict.fromkeys(names)]


def _bucket(name: str, buckets: int) -> int:
    return zlib.crc32(name.encode()) % buckets
