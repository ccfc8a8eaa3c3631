"""The sentences, the model that is trained on them, and that the shipped one is theirs."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.tagging import MEANINGS, LinearModel, in_use, lent, shipped, tag
from formup.evals.wordings.judge import verdicts
from formup.evals.wordings.sentences import Sentence, read_sentences, shipped_sentences
from formup.evals.wordings.train import known_words, store, train
from formup.tools.errors import InputError

TEN = (
    ("Glorp the mug with 4 bots.", "around", 4, ["the mug"]),
    ("Glorp the cup with 9 bots.", "around", 9, ["the cup"]),
    ("Glorp the big box with 5 bots.", "around", 5, ["the big box"]),
    ("Frimp the mug with 3 bots.", "inside", 3, ["the mug"]),
    ("Frimp the cup with 8 bots.", "inside", 8, ["the cup"]),
    ("Frimp the red box with 7 bots.", "inside", 7, ["the red box"]),
    ("Zant the mug with 6 bots.", "cage", 6, ["the mug"]),
    ("Zant the cup with 7 bots.", "cage", 7, ["the cup"]),
    ("Zant the box with 10 bots.", "cage", 10, ["the box"]),
    ("Glorp the plate with 12 bots.", "around", 12, ["the plate"]),
)


def line(text: str, meaning: str, robots: int, things: list[str], **more: list[str]) -> str:
    marks = {"things": things, "background": [], "demands": []} | more
    return json.dumps({"text": text, "relation": meaning, "robots": robots} | marks)


@pytest.fixture(scope="module")
def ten() -> tuple[Sentence, ...]:
    return tuple(read_sentences("ten", "\n".join(line(*row) for row in TEN)))


@pytest.fixture(scope="module")
def taught(ten: tuple[Sentence, ...]) -> LinearModel:
    return replace(train(ten), words=known_words(ten))


def test_marked_phrases_become_labels_of_words() -> None:
    text = "Sadly, ring the mug with 4 bots, 20 px off."
    marks = {"background": ["Sadly"], "demands": ["20 px off"]}
    (sentence,) = read_sentences("me", line(text, "around", 4, ["the mug"], **marks))
    labels = {w.text: label for w, label in zip(sentence.words, sentence.labels, strict=True)}
    assert labels["sadly"] == "background"
    assert labels["ring"] == labels["bots"] == "command"
    assert labels["the"] == labels["mug"] == "thing"
    assert labels["px"] == labels["off"] == "demand"


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (line("Ring it", "surround", 4, ["it"]), "me, line 1: relation 'surround'"),
        (line("Ring it", "around", 4, ["the mug"]), "me, line 1: 'the mug'"),
    ],
)
def test_what_is_wrong_with_a_sentence_is_said(row: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        list(read_sentences("me", row))


def test_training_on_ten_sentences_gives_a_model_that_reads_them(
    taught: LinearModel, ten: tuple[Sentence, ...]
) -> None:
    with lent(taught):
        for sentence in ten:
            assert tag(sentence.words).labels == sentence.labels, sentence.text
            reading = read_instruction(sentence.text)
            assert (reading.relation, reading.robots) == (sentence.meaning, sentence.robots)
    assert in_use() is shipped()


def test_such_a_model_reads_a_sentence_it_has_not_seen(taught: LinearModel) -> None:
    with lent(taught):
        reading = read_instruction("Zant the green mug with 11 bots.")
    assert (reading.relation, reading.robots, reading.things) == ("cage", 11, ["the green mug"])
    assert "zant" not in shipped().words


def test_a_stored_model_is_the_model_to_half_a_step(taught: LinearModel, tmp_path: Path) -> None:
    store(tmp_path / "model.npz", taught)
    stored = np.load(tmp_path / "model.npz")
    for name in ("emission", "transition", "command"):
        weights, step = getattr(taught, name), float(stored[f"{name}_step"])
        assert np.abs(stored[name] * step - weights).max() <= step / 2 + 1e-12


def test_there_are_sentences_of_many_hands_for_every_meaning() -> None:
    sentences = shipped_sentences()
    assert len({s.author for s in sentences}) >= 10
    assert len(sentences) >= 2_000
    assert set(Counter(s.meaning for s in sentences)) == set(MEANINGS)


def test_the_shipped_weights_belong_to_the_sentences() -> None:
    """Run `make wordings` after any change of sentences, features or training."""
    sentences = shipped_sentences()
    assert shipped().words == known_words(sentences)
    some = sentences[::10]
    right = sum(
        a == b
        for s in some
        for a, b in zip(shipped().labels([w.text for w in s.words])[0], s.labels, strict=True)
    )
    assert right > 0.97 * sum(len(s.words) for s in some)
    meant = [shipped().meaning([w.text for w in s.words], s.labels) for s in some]
    fits = sum(max(m, key=lambda k: m[k]) == s.meaning for m, s in zip(meant, some, strict=True))
    assert fits > 0.97 * len(some)


def test_few_sentences_are_read_wrongly_by_the_model_trained_on_them() -> None:
    counted = [s for s in shipped_sentences() if s.robots is not None][::8]
    found = verdicts(shipped(), counted)
    assert found["wrong"] < 0.02 * found.total()
    assert found["right"] + found["rightly asked"] > 0.6 * found.total()
