"""Evaluation of how well a model reads instructions of an author it was not trained on."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...agent.first_message import Task
from ...agent.offline.accounting import read_instruction
from ...agent.offline.drafting import question_of
from ...agent.offline.reading import Reading
from ...agent.offline.tagging import LinearModel, lent
from .sentences import Sentence
from .train import known_words, train

SCALE = 0.05
"""Metres per pixel of the picture for which sentences are read."""
TEMPERATURES = np.geomspace(0.5, 4, 25)


def by_author(sentences: Sequence[Sentence]) -> Iterator[tuple[str, LinearModel, list[Sentence]]]:
    """Yield each author with the model trained on all others, and the author's sentences."""
    for author in sorted({s.author for s in sentences}):
        others = [s for s in sentences if s.author != author]
        own = [s for s in sentences if s.author == author]
        yield author, replace(train(others), words=known_words(others)), own


def verdicts(model: LinearModel, sentences: Sequence[Sentence]) -> Counter[str]:
    """Count the sentences that are read right, wrong, asked about, and rightly asked about.

    The thing is pointed at. Right means the arrangement and the number that the author meant.
    """
    with lent(model):
        return Counter(_verdict(s) for s in sentences)


def _verdict(sentence: Sentence) -> str:
    reading = read_instruction(sentence.text, SCALE)
    targets = ("t1", "t2") if reading.relation == "between" else ("t1",)
    task = Task(sentence.text, sentence.robots, (), targets, True, SCALE)
    robots = sentence.robots or reading.robots or 5
    if question_of(task, reading, robots) is not None:
        return "rightly asked" if sentence.meaning in ("ask", "several") else "asked"
    counted = sentence.robots in (None, robots) and reading.robots in (None, sentence.robots)
    return "right" if _fits(reading, sentence.meaning) and counted else "wrong"


def _fits(reading: Reading, meaning: str) -> bool:
    if meaning == "several":
        return bool(reading.shares) or reading.rings > 1
    if meaning == "shape" and reading.relation == "around":  # a half ring is both
        return bool({"sides", "opening"} & set(reading.group))
    return reading.relation == meaning


def temperature(folds: Sequence[tuple[LinearModel, Sequence[Sentence]]]) -> float:
    """Return the temperature with the least loss on authors the models were not trained on."""
    losses = [
        -float(np.mean([np.log(_probability(replace(m, temperature=t), s)) for m, own in folds
                        for s in own]))
        for t in TEMPERATURES
    ]  # fmt: skip
    return float(TEMPERATURES[int(np.argmin(losses))])


def _probability(model: LinearModel, sentence: Sentence) -> float:
    words = [w.text for w in sentence.words]
    return model.meaning(words, model.labels(words)[0])[sentence.meaning]
