"""Resolves a description to the candidate it means, or says why it is ambiguous.

An answer is settled only if every doubtful measure, read either way, gives the same thing;
otherwise a person is to choose from the matches.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, get_args

import numpy as np

from ...errors import ToolError
from .attributes import Candidate
from .filters import (
    NO,
    POSSIBLE,
    SURE,
    Filter,
    IntArray,
    Things,
    attribute_filters,
    lacking,
    listed,
)
from .oddness import odd_one_out
from .query import Description, Oddness, Pick, Query, Relation, wording
from .ranking import Ranked, rank, rank_nearest
from .spatial import ground_filter, relation_filter
from .specks import speck_filter, specks_among, specks_note

__all__ = ["Description", "Match", "Pick", "Query", "Relation", "Selection", "select"]

MOST_READINGS = 64
"""The most combinations of what other things may be that are tried; if more, a person is asked."""

Others = tuple[tuple[int, ...], ...]
"""One reading of a query: for each relation, the indices of its other things."""


@dataclass(frozen=True)
class Match:
    """A candidate that may be meant, and the numbers that support it, a short sentence each."""

    id: str
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Selection:
    """What a description may mean.

    Attributes:
        matches: the candidates to choose from, the best first.
        settled: whether there is exactly one match, and the decision is not a close one.
        doubt: why it is not settled, one sentence; empty if it is.
        lacking: what there is instead, if nothing looks like the description; else empty.
        note: what else fits but was left out as a speck, one sentence; empty if nothing was.
    """

    matches: tuple[Match, ...]
    settled: bool
    doubt: str
    lacking: str
    note: str = ""


class _Step(NamedTuple):
    """A superlative: the word for its winner, and how to find that among things."""

    word: str
    decide: Callable[[IntArray], Ranked]


@dataclass(frozen=True)
class _Answer:
    """What is left of a set of things.

    Attributes:
        indices: the things, the best first.
        reasons: why, by index, short sentences.
        doubt: why it is not one clear thing; empty if it is.
        number: why the count of things that fit is not the stated one; empty if it is.
        note: which specks were left out; empty if none was.
    """

    indices: tuple[int, ...]
    reasons: dict[int, tuple[str, ...]]
    doubt: str
    number: str = ""
    note: str = ""


@dataclass(frozen=True)
class _Other:
    """What another thing in a relation may be; `covered`: whether it must be one of `indices`."""

    indices: tuple[int, ...]
    settled: bool
    covered: bool
    doubt: str


def select(
    candidates: Sequence[Candidate], query: Description, width: int, height: int
) -> Selection:
    """Find which of the candidates a description means, in a picture of width x height px.

    Args:
        candidates: in any order, with different ids.
        query: a description, or a query with relations to other things.

    Raises:
        ToolError: a relation names a candidate that does not exist, or one thing twice.
    """
    ordered = sorted(candidates, key=lambda c: (len(c.id), c.id))
    return _select(Things(tuple(ordered), width, height), query)


def _select(things: Things, query: Description) -> Selection:
    relations = query.relations if isinstance(query, Query) else ()
    others = [[_other_thing(things, thing) for thing in r.things] for r in relations]
    for relation in relations:
        ids = [t for t in relation.things if isinstance(t, str)]
        if len(set(ids)) < len(ids):
            raise ToolError(f"{relation.kind} needs two different things; got {ids[0]} twice.")
    looks = attribute_filters(things, query)
    if not (_degrees(things, looks) >= POSSIBLE).any():
        return Selection((), False, "", lacking(things, looks))
    for relation, found in zip(relations, others, strict=True):
        for other in found:
            if not other.indices:
                return Selection((), False, f"{relation.kind}: {other.doubt}", "")
    answers = [_answer_in(things, query, looks, reading) for reading in _readings(others)]
    if not answers:
        return Selection((), False, "the two things it is between are one and the same", "")
    merged = _merged(things, answers, [o for found in others for o in found], _capped(others))
    matches = tuple(Match(things.candidates[i].id, merged.reasons[i]) for i in merged.indices)
    return Selection(matches, not merged.doubt, merged.doubt, "", answers[0].note)


def _other_thing(things: Things, thing: str | Description) -> _Other:
    if isinstance(thing, str):
        return _Other((things.index(thing),), True, True, "")
    found = _select(things, thing)
    indices = tuple(things.index(m.id) for m in found.matches)
    sure = (_degrees(things, attribute_filters(things, thing)) == SURE).any()
    ids = " or ".join(m.id for m in found.matches[:4])
    more = f" or {len(indices) - 4} more" if len(indices) > 4 else ""
    doubt = f"{wording(thing)} could be {ids}{more} ({found.doubt})"
    if not indices:
        doubt = f"{wording(thing)} is not there: {found.lacking or found.doubt}"
    return _Other(indices, found.settled, bool(sure) and len(indices) > 1, doubt)


def _readings(others: list[list[_Other]]) -> list[Others]:
    """Return the readings of what the other things are, MOST_READINGS at most.

    None has a thing twice in one relation.
    """
    per_relation = [itertools.product(*(o.indices for o in found)) for found in others]
    ways = [[way for way in ways if len(set(way)) == len(way)] for ways in per_relation]
    return list(itertools.islice(itertools.product(*ways), MOST_READINGS))


def _capped(others: list[list[_Other]]) -> bool:
    sizes = [len(o.indices) for found in others for o in found]
    return int(np.prod(sizes, dtype=float)) > MOST_READINGS


def _merged(things: Things, answers: list[_Answer], others: list[_Other], capped: bool) -> _Answer:
    """Merge the answers of all readings; doubtful unless they agree and none is doubtful itself."""
    first, unsettled = answers[0], [o for o in others if not o.settled]
    if not unsettled:
        return first
    indices = tuple(dict.fromkeys(i for a in answers for i in a.indices))
    reasons = {i: r for a in reversed(answers) for i, r in a.reasons.items()}
    covered = not capped and all(o.covered for o in unsettled)
    doubt = ""
    if not indices:
        doubt = first.doubt
    elif not covered or len(indices) != 1 or any(a.doubt for a in answers):
        doubt = unsettled[0].doubt
    return _Answer(indices, reasons, doubt)


def _degrees(things: Things, filters: Sequence[Filter]) -> IntArray:
    everything = np.full(len(things.candidates), SURE, dtype=np.int64)
    return np.minimum.reduce([everything, *(f.degrees for f in filters)])


def _answer_in(things: Things, query: Description, looks: list[Filter], others: Others) -> _Answer:
    """Return the answer in one reading, in which the other things are known."""
    relations = query.relations if isinstance(query, Query) else ()
    where = [
        relation_filter(things, r.kind, other) for r, other in zip(relations, others, strict=True)
    ]
    filters = [*looks, *where]
    fitting = np.flatnonzero(_degrees(things, filters) > NO)
    if not len(fitting):
        return _Answer((), {}, _empty_relation(things, looks, where, others))
    steps = _ordering_steps(things, query, others)
    specks = _left_out(things, query, _degrees(things, filters))
    note = specks_note(things, specks, _degrees(things, filters))
    filters.append(speck_filter(things, specks))
    if steps:
        filters.append(ground_filter(things, np.setdiff1d(fitting, specks)))
    degrees = _degrees(things, filters)
    loose, strict = np.flatnonzero(degrees >= POSSIBLE), np.flatnonzero(degrees == SURE)
    possibly = _picked(things, query, steps, loose)
    same = len(strict) == len(loose)
    surely = possibly if same else _picked(things, query, steps, strict)
    answer = _combined(surely, possibly, _doubt_about(things, filters, degrees, possibly.indices))
    reasons = {
        i: (*filter(None, (f.explain(i) for f in filters)), *answer.reasons.get(i, ()))
        for i in answer.indices
    }
    return replace(answer, reasons=reasons, note=note)


def _left_out(things: Things, query: Description, degrees: IntArray) -> IntArray:
    """Return the specks that do not count; a plain description keeps the only rival of a thing.

    Being tiny may be what makes a thing the odd one out.
    """
    specks = specks_among(things, degrees)
    if any(p.by in get_args(Oddness) for p in query.picks):
        return specks[:0]
    counted = isinstance(query, Query) and query.count is not None
    several = (degrees > NO).sum() - len(specks) > 1
    return specks if query.picks or counted or several else specks[:0]


def _combined(surely: _Answer, possibly: _Answer, perhaps: str) -> _Answer:
    """Combine the answers among the things that surely fit and among all that possibly do.

    Args:
        surely: the first answer; without indices if nothing surely fits.
        possibly: the second answer, which includes doubtful things.
        perhaps: the doubt about those things; empty if there are none.
    """
    indices = tuple(dict.fromkeys((*surely.indices, *possibly.indices)))
    reasons = possibly.reasons | surely.reasons
    same = surely.indices == possibly.indices and len(indices) == 1
    doubt = surely.doubt or ("" if same else perhaps) or possibly.doubt
    if not doubt and surely.number and possibly.number:
        doubt = surely.number
    return _Answer(indices, reasons, doubt)


def _doubt_about(
    things: Things, filters: list[Filter], degrees: IntArray, answer: tuple[int, ...]
) -> str:
    """Say which thing only possibly fits, and why: one of the answer, else any; empty if none."""
    doubtful = [int(i) for i in np.flatnonzero(degrees == POSSIBLE)]
    if not doubtful:
        return ""
    index = next((i for i in answer if i in doubtful), doubtful[0])
    why = next(f for f in filters if f.degrees[index] == POSSIBLE)
    too = " too" if (degrees == SURE).any() else ""
    return f"{things.candidates[index].id} may be {why.word}{too} ({why.explain(index)})"


def _empty_relation(
    things: Things, looks: list[Filter], where: list[Filter], others: Others
) -> str:
    """Say which relation left nothing."""
    kept = list(looks)
    for found, other in zip(where, others, strict=True):
        fitting = set(np.flatnonzero(_degrees(things, kept) > NO).tolist()) - set(other)
        kept.append(found)
        if not (_degrees(things, kept) > NO).any():
            if not fitting:
                itself = listed(things.candidates, np.array(other))
                return f"nothing but {itself} itself fits otherwise"
            if len(fitting) == 1:
                return f"the one thing that fits otherwise is not {found.word}"
            return f"none of the {len(fitting)} things that fit otherwise is {found.word}"
    raise AssertionError("something is left")


def _ordering_steps(things: Things, query: Description, others: Others) -> list[_Step]:
    """Return what orders the things that fit: nearness, then the picks, or else the shade."""
    relations = query.relations if isinstance(query, Query) else ()
    steps = [
        _Step(
            f"nearest to {things.candidates[other].id}", partial(rank_nearest, things, other=other)
        )
        for relation, (other, *_) in zip(relations, others, strict=True)
        if relation.kind == "nearest"
    ]
    steps += [_Step(wording(Description(picks=(p,)))[4:-4], _pick(things, p)) for p in query.picks]
    several = isinstance(query, Query) and query.count is not None and query.count > 1
    if not steps and query.shade and not several:
        extreme = Pick(by="darkest" if query.shade == "dark" else "lightest")
        steps.append(_Step(extreme.by, _pick(things, extreme)))
    return steps


def _pick(things: Things, pick: Pick) -> Callable[[IntArray], Ranked]:
    for by in get_args(Oddness):
        if by == pick.by:
            return lambda members: odd_one_out(things, members, by)
    return lambda members: rank(things, members, pick)


def _picked(things: Things, query: Description, steps: list[_Step], members: IntArray) -> _Answer:
    """Return which of the members the steps leave."""
    if not len(members):
        return _Answer((), {}, "")
    members, number = _matching_count(things, query, members)
    if not steps:
        doubt = f"{len(members)} things fit: {listed(things.candidates, members)}"
        indices = tuple(int(i) for i in members)
        return _Answer(indices, {}, doubt if len(members) > 1 else "", number)
    if len(members) == 1 and all(p.place == 1 for p in query.picks):
        return _Answer((int(members[0]),), {}, "", number)
    return replace(_first_step_winner(things, steps, members), number=number)


def _first_step_winner(things: Things, steps: list[_Step], members: IntArray) -> _Answer:
    """Return the winner of the first step; it is doubtful if another step contradicts it."""
    ranked = [step.decide(members) for step in steps]
    first, later = ranked[0], ranked[1:]
    agreeing = [i for i in first.contenders if all(i in r.contenders for r in later)]
    indices = tuple(dict.fromkeys((*agreeing, *first.contenders)))
    doubt = first.doubt
    if not doubt:
        name = things.candidates[first.contenders[0]].id
        for step, found in zip(steps[1:], later, strict=True):
            if first.contenders[0] not in found.contenders:
                shown = listed(things.candidates, np.array(found.contenders, dtype=np.int64))
                but = f"{step.word} is {shown}" if shown else found.doubt
                doubt = doubt or f"{name} is {steps[0].word}, but {but}"
                indices = tuple(dict.fromkeys((*indices, *found.contenders)))
    reasons = {i: tuple(r.reasons[i] for r in ranked if i in r.reasons) for i in indices}
    return _Answer(indices, reasons, doubt)


def _matching_count(things: Things, query: Description, members: IntArray) -> tuple[IntArray, str]:
    """Reduce the members to those meant if their number was stated, and say why it does not match.

    If just the things that the picture's border does not cut make up that number, these are meant.
    """
    count = query.count if isinstance(query, Query) else None
    if count is None or len(members) == count:
        return members, ""
    whole = [not things.candidates[int(i)].attributes.touches_border for i in members]
    if len(members) > count == sum(whole):
        return members[np.array(whole)], ""
    fit = f"{len(members)} thing{'s fit' if len(members) > 1 else ' fits'}"
    shown = listed(things.candidates, members)
    return members, f"{fit} where {count} {'was' if count == 1 else 'were'} said: {shown}"
