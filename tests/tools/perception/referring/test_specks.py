"""Specks take no part in ranks and counts, and a note says so."""

import pytest
from formup.tools.perception.referring.attributes import Candidate
from formup.tools.perception.referring.query import Pick, Query, Relation
from formup.tools.perception.referring.relations import Selection, select
from hypothesis import given, settings
from hypothesis import strategies as st

from .test_relations import disc, thing

FEW = settings(derandomize=True, deadline=None, max_examples=60)


def row(*radii: float) -> list[Candidate]:
    """Discs from left to right."""
    places = [(60 + 110 * k, 400) for k in range(len(radii))]
    return [
        thing(f"c{k + 1}", at, disc(radius))
        for k, (at, radius) in enumerate(zip(places, radii, strict=True))
    ]


def found(things: list[Candidate], **query: object) -> Selection:
    return select(things, Query.model_validate(query), 1000, 800)


def names(selection: Selection) -> list[str]:
    return [m.id for m in selection.matches]


def test_a_rank_counts_things_and_no_speck() -> None:
    things = row(30, 5, 34, 31)
    second = found(things, picks=(Pick(by="leftmost", place=2),))
    assert (names(second), second.settled) == (["c3"], True)
    assert second.note.startswith("c2 is left out as too small to be one of them: 9 px across")
    assert names(found(things, picks=(Pick(by="leftmost"),))) == ["c1"]
    last = found(things, picks=(Pick(by="leftmost", place=4),))
    assert last.doubt == "there are 3 things to pick from, so there is no place 4"


def test_a_count_counts_things_and_no_speck() -> None:
    pair = found(row(30, 34, 5), count=2)
    assert (names(pair), pair.doubt) == (["c1", "c2"], "2 things fit: c1, c2")
    listed = found(row(30, 34, 5, 31))
    assert names(listed) == ["c1", "c2", "c4"]
    assert listed.note.startswith("c3 is left out")


def test_the_only_rival_of_a_thing_stays_a_rival() -> None:
    plain = found(row(30, 4))
    assert (names(plain), plain.settled, plain.note) == (["c1", "c2"], False, "")


def test_what_surely_fits_is_the_measure() -> None:
    speck, *others = row(5, 30, 34)
    partly = (("blue", 0.6), ("red", 0.4))
    perhaps = [thing(o.id, o.attributes.centre, disc(30), colours=partly) for o in others]
    surely = found([speck, *perhaps], colours=("red",), picks=(Pick(by="largest"),))
    assert "c1" in names(surely)
    assert surely.note == ""


def test_being_tiny_may_be_odd() -> None:
    odd = found(row(30, 31, 30, 29, 5), picks=(Pick(by="odd_size"),))
    assert (names(odd), odd.note) == (["c5"], "")


def test_small_things_among_small_things_are_things() -> None:
    smallest = found(row(6, 8, 7, 4), picks=(Pick(by="smallest"),))
    assert (names(smallest), smallest.note) == (["c4"], "")


def test_a_small_thing_is_none_where_the_picture_shows_it_large() -> None:
    assert found(row(180, 40), picks=(Pick(by="smallest"),)).note == ""


def test_other_things_are_ranked_without_specks_too() -> None:
    things = [thing("c1", (200, 200), disc(30), "blue"), *row(9, 5, 33, 31)[1:]]
    left = Relation(kind="below", things=(Query(colours=("blue",)),))
    below = found(things, relations=(left,), picks=(Pick(by="smallest"),))
    assert "c2" not in names(below)


@FEW
@given(radii=st.lists(st.floats(28, 40), min_size=2, max_size=7), speck=st.floats(2, 6.5))
@pytest.mark.parametrize("by", ["largest", "smallest", "leftmost", "middle"])
def test_a_speck_changes_no_rank(by: str, radii: list[float], speck: float) -> None:
    things = row(*radii)
    crumb = thing(f"c{len(radii) + 1}", (500, 700), disc(speck))
    pick = (Pick.model_validate({"by": by}),)
    without, beside = found(things, picks=pick), found([*things, crumb], picks=pick)
    assert (names(without), without.doubt) == (names(beside), beside.doubt)
