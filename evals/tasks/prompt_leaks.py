"""Leaks of evaluation tasks into prompts: words of a task, or places in its picture.

A prompt that contains them is graded on what it was told. Optimisers copy them in by themselves
(gepa-ai/gepa, issue 261).
"""

import re
from collections.abc import Iterable
from functools import cache
from itertools import chain

from ...prompts import Prompt
from ...prompts.lint import Finding
from ..scenes.stories import wordings
from .suites import load_suite
from .task import Task

WORDS = 5
"""So many words in a row that also occur in a task are no coincidence."""
_PAIR = re.compile(r"[\[(]?\b([0-9]+(?:\.[0-9]+)?)\s*,\s*([0-9]+(?:\.[0-9]+)?)\b")


def leaks(prompt: Prompt) -> list[Finding]:
    """Return findings on words and places of shipped suites in a prompt, examples or defaults."""
    given = prompt.front.inputs.values()
    text = "\n".join([prompt.text, *(str(v) for i in given for v in (i.example, i.default) if v)])
    texts, places = _known_content()
    copied = sorted(_word_runs(text) & texts)
    found = [f"It has words of a task: {' '.join(run)!r}." for run in copied]
    for match in _PAIR.finditer(text):
        if (float(match[1]), float(match[2])) in places:
            found.append(f"It has a place in a picture of a task: {match[0].strip('[(')}.")
    return [Finding(prompt.name, "leak", "error", sentence) for sentence in found]


@cache
def _known_content() -> tuple[frozenset[tuple[str, ...]], frozenset[tuple[float, float]]]:
    """Return runs of words, and places (x, y) px, of the tasks that ship with formup."""
    tasks = [task for name in ("photos", "many") for task in load_suite(name).tasks]
    parts = [part for words in wordings() for part in words.values()]
    templates = chain.from_iterable(some for part in parts for some in part.values())
    texts = chain([task.instruction for task in tasks], templates)
    runs = {run for text in texts for run in _word_runs(text)}
    return frozenset(runs), frozenset(place for task in tasks for place in _places(task))


def _word_runs(text: str) -> set[tuple[str, ...]]:
    """Return all runs of five words in a text; a slot such as {thing} counts as a word."""
    words = re.findall(r"\{?\w+\}?", text.lower())
    return {tuple(words[i : i + WORDS]) for i in range(len(words) - WORDS + 1)}


def _places(task: Task) -> Iterable[tuple[float, float]]:
    """Yield where robots should stand, and the corners of the outlines and boxes of the things."""
    for point in (point for goal in task.goals for point in goal.success.get("points", ())):
        yield float(point[0]), float(point[1])
    for thing in task.things:
        x0, y0, x1, y1 = thing.outline.bounds
        yield from ((x, y) for ring in (thing.polygon, *thing.holes) for x, y in ring)
        yield from ((x, y) for x in (x0, x1) for y in (y0, y1))
