"""Every number and every word of every wording there is ends in the contract or in a quote."""

import json
import re
from collections.abc import Iterator
from dataclasses import asdict
from functools import cache
from pathlib import Path

import formup
import pytest
import yaml
from formup.agent.first_message import Task as FirstMessage
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.drafting import question_of, things_needed
from formup.agent.offline.lexicon import fillers, may_command
from formup.agent.offline.reading import Reading
from formup.agent.offline.tagging import tag, tokens
from formup.evals.tasks.suites import load_suite, shipped
from formup.evals.tasks.task import Task
from formup.evals.wordings.sentences import shipped_sentences
from formup.tools.formation.quantities import Quantity, quantities_in

FAULT = pytest.mark.xfail(strict=True, reason="a known fault of the reading")
ROOT = Path(formup.__file__).parent
SCALE = 0.05
UNKNOWN = "zorvel"
"""Stands in for a word: where nothing changes by it, the word was not accounted for."""
STRIDE = 6
"""Words are tried one by one in every so many wordings, numbers in all."""
SPLITS = {"formation-dev": ("train", "dev", "test")}


KINDS = {"side": "along", "center": "centre", "line_between": "between", "boundary": "around"}


@cache
def tasks() -> tuple[Task, ...]:
    """The tasks of all suites."""
    parts = [(name, split) for name in shipped() for split in SPLITS.get(name, ("dev",))]
    return tuple(t for name, split in parts for t in load_suite(name, split).tasks)


@cache
def wordings() -> tuple[str, ...]:
    """Instructions of suites, photographs, drawn scenes and authors."""
    found: list[str] = [s.text for s in shipped_sentences()]
    found += [task.instruction for task in tasks()]
    for path in sorted((ROOT / "evals/photos").glob("*.json")):
        if path.name != "schema.json":
            entries = json.loads(path.read_text("utf-8"))
            found += [task["instruction"] for entry in entries for task in entry["tasks"]]
    for name in ("wordings.yaml", "fresh.yaml"):
        groups = yaml.safe_load((ROOT / "evals/scenes" / name).read_text("utf-8"))["arrangements"]
        filled = {"n": "six", "thing": "the red box", "side": "left"}
        found += [template.format_map(filled) for rows in groups.values() for template in rows]
    return tuple(dict.fromkeys(found))


def outcome(text: str) -> str:
    """All that is understood of an instruction, probabilities apart."""
    reading = read_instruction(text, SCALE)
    return repr(asdict(reading) | {"meanings": reading.relation})


def quoted(text: str, reading: Reading) -> set[int]:
    """Where characters stand that a phrase for a thing or another quote holds."""
    quotes = [*reading.things, *reading.others, reading.faced, *reading.unread]
    quotes += [*reading.background, *reading.unscaled, reading.odd_count]
    quotes += [words for _, words in reading.stops]
    found: set[int] = set()
    for quote in filter(None, quotes):
        pattern = r"\s+".join(map(re.escape, quote.split()))
        for match in re.finditer(pattern, text):
            found.update(range(*match.span()))
    words = tokens(text)
    known = may_command([w.text for w in words], reading.relation)
    for word, label in zip(words, tag(words, known).labels, strict=True):
        if label == "thing":  # a demand may have taken the phrase: "left side of the red box"
            found.update(range(word.start, word.end))
    return found


def changed(quantity: Quantity) -> str:
    return "77 px" if quantity.is_length else "77" if quantity.least != 77 else "78"


def unaccounted(text: str, with_words: bool) -> Iterator[str]:
    """Numbers and words, outside fillers and quotes, that change nothing of what is read."""
    quantities = quantities_in(text)
    if not (quantities or with_words):
        return
    reading, before = read_instruction(text, SCALE), outcome(text)
    inside = quoted(text, reading)
    spots = [(q.start, q.end, changed(q), q.wording) for q in quantities]
    if with_words:
        spots += [
            (w.start, w.end, UNKNOWN, w.text)
            for w in tokens(text)
            if w.text[0].isalpha()
            and w.text not in fillers()
            and not any(q.start <= w.start < q.end for q in quantities)
        ]
    for start, end, other, wording in spots:
        if start not in inside and outcome(text[:start] + other + text[end:]) == before:
            yield wording


def test_there_are_wordings_of_every_kind() -> None:
    assert len(wordings()) > 2_500
    assert any("red box" in text for text in wordings())


@FAULT
def test_every_number_of_the_wordings_is_accounted_for() -> None:
    lost = {text: found for text in wordings() if (found := list(unaccounted(text, False)))}
    assert lost == {}


@FAULT
def test_every_word_of_the_wordings_is_accounted_for() -> None:
    some = wordings()[::STRIDE]
    lost = {text: found for text in some if (found := list(unaccounted(text, True)))}
    assert lost == {}


def test_a_word_that_nothing_reads_is_seen() -> None:
    """What the test above looks for: this reading says nothing of "frobnicate"."""
    assert UNKNOWN not in fillers()
    assert UNKNOWN in outcome(f"Surround it with 6 robots, {UNKNOWN}")


def test_instructions_of_the_suites_are_read_as_their_rules_mean_them() -> None:
    """Asked about, or read as the arrangement and the number that are graded."""
    wrong: list[str] = []
    for task in tasks():
        scale = task.metres_per_pixel
        reading = read_instruction(task.instruction, scale)
        pointed = ("t1", "t2")[: things_needed(reading)]
        first = FirstMessage(task.instruction, task.robots, (), pointed, True, scale)
        asked = question_of(first, reading, task.robots or reading.robots)
        if asked is not None or len(task.goals) != 1:
            continue
        rule = task.goals[0].success
        where = str(rule["where"]).partition(":")[0]
        meant = "cage" if rule.get("closed") else KINDS.get(where, where)
        if reading.relation != meant or reading.robots not in (None, task.robots):
            wrong.append(f"{reading.relation} {reading.robots}: {task.instruction}")
    assert wrong == []
