"""How well things are found by their colour, and what is found where no such thing is there."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from ...tools.errors import InputError
from ...tools.geometry.outline import outline_of
from ...tools.perception.detectors.candidates import find_candidates, salient_candidates
from ...tools.perception.image import Picture, load_picture
from ...tools.perception.referring.attributes import Candidate, ColourName
from ...tools.perception.referring.colours import colour_shares
from ...tools.perception.referring.measure_attributes import candidate_of
from ...tools.perception.referring.relations import Query, select
from ..tasks.suites import load_suite
from ..tasks.task import Thing

FOUND = 0.5
"""Least overlap with the true region of a candidate that is the thing."""
LACKS = 0.001
"""A picture in which less than this share of the pixels has a colour holds no thing of it."""
THINGS_PER_ABSENT = 3
"""One colour that is not there is asked for with so many things, so that a quarter is absent."""


@dataclass(frozen=True)
class Search:
    """One colour asked for in one picture, and what came.

    Attributes:
        picture, colour: what was asked.
        present: whether it is the main colour of a thing there, that which is looked for.
        matches: how many candidates were named.
        found: whether the thing is among them.
        settled: whether exactly one was named as clearly meant.
    """

    picture: str
    colour: ColourName
    present: bool
    matches: int
    found: bool
    settled: bool


def searches(suite: str) -> Iterator[Search]:
    """Yield a search for each thing of a suite's pictures, and those for what is not there.

    Raises:
        InputError: no such suite, or it has no picture file.
    """
    things: dict[Path, dict[str, Thing]] = defaultdict(dict)
    for task in load_suite(suite).tasks:
        if isinstance(task.picture, Path):
            things[task.picture] |= {thing.id: thing for thing in task.things}
    if not things:
        raise InputError(f"No task of the suite {suite} has a picture to search.")
    for path, shown in things.items():
        picture = load_picture(path)
        candidates = salient_candidates(find_candidates(picture.pixels))
        for thing in shown.values():
            outline = outline_of(thing.region)
            colour = candidate_of("c1", outline, picture, 1.0).attributes.colour
            yield _search(picture, candidates, colour, thing)
        for colour in _lacking(picture)[: -(-len(shown) // THINGS_PER_ABSENT)]:
            yield _search(picture, candidates, colour, None)


def _lacking(picture: Picture) -> list[ColourName]:
    """Return the colours that a picture has nowhere, in the order of their names."""
    there = dict(colour_shares(picture.pixels.reshape(-1, 3)))
    return sorted(c for c in get_args(ColourName) if there.get(c, 0.0) < LACKS)


def _search(
    picture: Picture, candidates: Sequence[Candidate], colour: ColourName, thing: Thing | None
) -> Search:
    selection = select(candidates, Query(colours=(colour,)), *picture.size)
    ids = {match.id for match in selection.matches}
    named = [c.outline.polygon for c in candidates if c.id in ids]
    found = thing is not None and any(thing.overlap(region) >= FOUND for region in named)
    return Search(picture.name, colour, thing is not None, len(ids), found, selection.settled)


def finding_table(by_suite: Mapping[str, Sequence[Search]]) -> str:
    """Return recall and false finds of suites as a Markdown table."""
    lines = [
        "| suite | things | found by colour | settled on it | settled on another | not there |"
        " something found | settled |",
        "|" + "---|" * 8,
    ]
    for suite, made in by_suite.items():
        there, absent = [s for s in made if s.present], [s for s in made if not s.present]
        shares = [
            _held_share([s.found for s in there]),
            _held_share([s.found and s.settled for s in there]),
            _held_share([s.settled and not s.found for s in there]),
        ]
        false = [
            _held_share([s.matches > 0 for s in absent]),
            _held_share([s.settled for s in absent]),
        ]
        cells = [suite, str(len(there)), *shares, str(len(absent)), *false]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _held_share(held: Sequence[bool]) -> str:
    return f"{np.mean(held):.3f}" if held else "-"
