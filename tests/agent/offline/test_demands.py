"""Demands beside number, thing and arrangement: what each rule takes, each word once."""

import re
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import formup
import pytest
import yaml
from formup.agent.offline.accounting import read_instruction
from formup.agent.offline.demand_fields import LENGTHS, Fields
from formup.agent.offline.demands import Demand, Item, demands_in, items_of, says_more, stops_in
from formup.agent.offline.tagging import tag, tokens
from formup.evals.wordings.sentences import shipped_sentences
from formup.tools.formation.number_words import SMALL, TENS

ASKED_ABOUT = {"beyond", "border"}
"""What rules take so that nothing else does; no contract has it."""


@cache
def table() -> dict[str, Any]:
    path = Path(formup.__file__).parent / "agent/offline/demands.yaml"
    return yaml.safe_load(path.read_text("utf-8"))


def items(text: str) -> tuple[Item, ...]:
    words = tokens(text)
    return items_of(text, words, tag(words))


def demands(text: str) -> dict[str, Demand]:
    return {d.sets: d for d in demands_in(items(text))}


def test_every_rule_is_carried_over_or_asked_about() -> None:
    sizes = {*LENGTHS, "robot_radius", "robot_diameter", *ASKED_ABOUT}
    for rule in table()["rules"]:
        assert rule["sets"] in sizes or hasattr(Fields, f"_{rule['sets']}"), rule["sets"]


def test_every_list_of_words_is_used() -> None:
    written = str(table()["rules"]) + str(table()["words"])
    for name in table()["words"]:
        assert f"{{{name}}}" in written, name


def test_no_pattern_waits_for_a_number_in_words() -> None:
    """Numbers are <n> in the line, so that "two" alone in a pattern never matches."""
    numbers = "|".join(sorted({*SMALL, *TENS} - {"one"}))
    written = [p for rule in table()["rules"] for p in rule["patterns"]]
    for pattern in [*written, *table()["words"].values()]:
        for match in re.finditer(rf"\b(?:{numbers})\b", str(pattern)):
            assert "<n>" in pattern, f"{match[0]} in {pattern}"


@pytest.mark.parametrize(
    ("words", "sets", "bound", "px"),
    [
        ("Ring the lid with 8 robots, at least 35 px away", "clearance", "least", 35),
        ("Ring the lid with 8 robots, 35 px away", "clearance", "", 35),
        ("Ring the lid with 8 robots, no more than 35 px away", "clearance", "most", 35),
        ("Ring the lid with 8 robots, at most 35 px apart", "max_gap", "most", 35),
        ("Ring the lid with 8 robots, 35 px apart", "pitch", "", 35),
        ("Ring the lid with 8 robots, leaving a 35 px gap", "opening", "", 35),
        ("Ring the lid with 8 robots on a circle of radius 35 px", "radius", "", 35),
        ("Ring the lid with 8 robots of radius 35 px", "robot_radius", "", 35),
    ],
)
def test_a_length_is_taken_by_the_rule_of_what_it_is_said_of(
    words: str, sets: str, bound: str, px: float
) -> None:
    found = demands(words)
    assert {*found} & {*LENGTHS, "robot_radius", "robot_diameter"} == {sets}
    demand = found[sets]
    assert demand.quantity is not None
    assert (demand.bound, demand.quantity.least) == (bound, px)


@pytest.mark.parametrize(
    ("words", "sets", "sides"),
    [
        ("Line up 5 robots along the left side of the lid", "side", ("left",)),
        ("Line up 5 robots along the northern edge of the lid", "side", ("top",)),
        ("Line up 5 robots on its right hand side", "side", ("right",)),
        ("Put 3 robots on the left and 2 on the right of it", "groups", ("left", "right")),
        ("Ring it with 6 robots, leave the bottom free", "free_side", ("bottom",)),
        ("Ring it with 6 robots with a doorway on the east side", "opening", ("right",)),
    ],
)
def test_sides_have_one_name_each(words: str, sets: str, sides: tuple[str, ...]) -> None:
    assert demands(words)[sets].sides == sides


@pytest.mark.parametrize(
    "words",
    [
        "If it would not be too much bother, ring it with 6 robots",
        "Ring it with 6 robots if that is fine with you",
        "Ring it with 6 robots as if they were statues",
        "We eat late tonight. Ring it with 6 robots",
        "Put 6 robots on its left and then 2 more at its top",
        "Ring it with 6 robots and hold off 30 px",
    ],
)
def test_courtesy_and_what_only_tells_stop_nothing(words: str) -> None:
    assert not stops_in(items(words))


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ("Ring it with 6 robots if it snows", "a condition"),
        ("Ring it with 6 robots as soon as the van leaves", "a condition"),
        ("Under no circumstances ring it", "a negation"),
        ("Cancel the ring of 6 robots", "a cancellation"),
        ("Ring it with 6 robots and follow it", "an ongoing movement"),
        ("Ring it with 6 robots, led by robot 3", "robots by name"),
        ("Ring it with 6 robots tonight", "a time"),
        ("Ring it with 6 robots. Tomorrow.", "a time"),
        ("Ring it with 6 robots, most of them clusters", "an uneven spread"),
    ],
)
def test_what_is_no_order_to_place_robots_now_stops(words: str, kind: str) -> None:
    found = stops_in(items(words))
    assert kind in [k for k, _, _ in found]
    for _, start, end in found:
        assert words[start:end].strip() == words[start:end] != ""


@pytest.mark.parametrize(
    "words", ["Ring it with 6 robots", "Put 6 robots around the lid, 20 px away, evenly, please"]
)
def test_plain_orders_do_not_stop(words: str) -> None:
    assert stops_in(items(words)) == ()


@pytest.mark.parametrize(
    ("phrase", "more"),
    [
        ("every lid", True),
        ("both of the lids", True),
        ("the upper part of the lid", True),
        ("the lid from two sides", True),
        ("anything but the lid", True),
        ("the lid", False),
        ("the upper lid", False),
        ("the lid in the left part of the picture, not the one beside it", False),
    ],
)
def test_phrases_that_say_more_than_which_thing(phrase: str, more: bool) -> None:
    assert says_more(phrase) == more


def test_no_item_is_in_two_demands() -> None:
    for sentence in shipped_sentences()[::12]:
        taken = [k for d in demands_in(items(sentence.text)) for k in range(d.first, d.last)]
        assert len(taken) == len(set(taken)), sentence.text


def test_items_are_the_instruction_in_order() -> None:
    for sentence in shipped_sentences()[::12]:
        found = items(sentence.text)
        assert all(a.end <= b.start for a, b in pairwise(found))
        between = [sentence.text[a.end : b.start] for a, b in pairwise(found)]
        assert not any(re.search(r"\w", gap) for gap in between), sentence.text
        for item in found:
            text = sentence.text[item.start : item.end]
            assert item.symbol.startswith("<") or item.symbol == text.lower().replace("\u2019", "'")
            assert (item.quantity is None) == (
                item.symbol not in ("<n>", "<l>", "<a>", "<s>", "<c>")
            )


@pytest.mark.parametrize(
    ("words", "thing", "robots"),
    [
        ("Surround the red one with six robots", "the red one", 6),
        ("cage the big one with 12 bots, 30 px off", "the big one", 12),
        ("surround the one on the left with 8 robots", "the one on the left", 8),
        ("surround the tree with one robot", "the tree", 1),
    ],
)
def test_a_one_in_place_of_a_noun_counts_no_robots(words: str, thing: str, robots: int) -> None:
    reading = read_instruction(words)
    assert ([*reading.things], reading.robots, [*reading.unread]) == ([thing], robots, [])


@pytest.mark.parametrize(
    ("words", "group"),
    [
        ("8 guards around the king with their backs to him", {"heading": "away"}),
        ("10 robots in a circle where each is 35 px from the next one", {"pitch": 35.0}),
        ("11 robots around the coin, practically touching it", {"fit": "tight"}),
        ("nobody closer than 45 px to the stove, ring of nine", {"clearance": [45.0, 100_000]}),
    ],
)
def test_what_follows_a_thing_is_demanded(words: str, group: dict[str, Any]) -> None:
    reading = read_instruction(words)
    assert (reading.group, [*reading.unread]) == (group, [])


@pytest.mark.parametrize(
    "words",
    [
        "two robots per corner of the crate",
        "8 in it or around it",
        "put 8 robots around it or not",
    ],
)
def test_several_per_corner_and_choices_are_asked_about(words: str) -> None:
    reading = read_instruction(words)
    assert reading.unread or reading.stops


def test_a_couple_more_robots_on_the_other_side_are_counted() -> None:
    reading = read_instruction("Half a dozen on the left of the bench and a couple on the right")
    assert reading.shares == [("left", 6), ("right", 2)]


@pytest.mark.parametrize(
    "words",
    [
        "Three quarters of a circle with 9 robots, the missing quarter at lower left",
        "Maybe a hexagon? Six robots, one per corner, 32 px from the thing.",
    ],
)
def test_parts_of_a_ring_and_forms_in_passing_are_asked_about(words: str) -> None:
    assert read_instruction(words).unread
