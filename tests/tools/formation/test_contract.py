"""Contracts: what is wrong with them is said at once, what they leave open is written out."""

import json
from typing import Any

import pytest
from formup.tools.formation.contract import (
    FIT_FACTOR,
    Contract,
    Group,
    ShapeSpec,
    default_clearance,
    nominal,
    with_defaults,
)
from formup.tools.geometry.outline import make_outline
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from pydantic import ValidationError

SQUARE = make_outline([(100, 100), (200, 100), (200, 200), (100, 200)])
ROOM = (400.0, 300.0)
OUTLINES = {"t1": SQUARE, "t2": make_outline([(250, 100), (300, 100), (300, 200), (250, 200)])}

GROUPS: list[dict[str, Any]] = [
    {"relation": "around", "targets": ["t1"], "robots": 4},
    {"relation": "around", "targets": ["t1"], "robots": 4, "clearance": [5, 30], "fit": "wide"},
    {"relation": "cage", "targets": ["t1"], "robots": 7, "max_gap": 40.0},
    {"relation": "corners", "targets": ["t1"], "robots": 4, "spacing": "free"},
    {"relation": "along", "targets": ["t1"], "robots": 3, "side": "left", "min_spacing": 9.5},
    {"relation": "along", "targets": ["t1"], "robots": 3, "edges": [0, 2]},
    {"relation": "inside", "targets": ["t1"], "robots": 3},
    {"relation": "between", "targets": ["t1", "t2"], "robots": 3, "layout": "divider"},
    {"relation": "centre", "targets": ["t1"], "robots": 3},
    {"relation": "shape", "robots": 3, "line": [0, 0, 10.5, 20]},
]


def test_every_problem_of_a_group_is_named_at_once() -> None:
    with pytest.raises(ValidationError) as caught:
        Group.model_validate(
            {
                "relation": "around",
                "targets": ["a", "b"],
                "robots": 3,
                "clearance": [9, 2],
                "side": "left",
                "edges": [1],
                "walls": True,
                "closure": "ring",
                "line": [0, 0, 1, 1],
            }
        )
    text = str(caught.value)
    for part in (
        "around takes 1 target(s), got 2",
        "clearance (9.0, 2.0)",
        "side belongs to along",
        "edges belongs to along",
        "walls belongs to cage",
        "closure belongs to cage",
        "line belongs to shape",
    ):
        assert part in text


@pytest.mark.parametrize(
    ("group", "said"),
    [
        ({"relation": "along", "targets": ["t1"], "robots": 2}, "either a side or edges"),
        (
            {"relation": "along", "targets": ["t1"], "robots": 2, "side": "left", "edges": [0]},
            "either a side or edges",
        ),
        ({"relation": "between", "targets": ["t1"], "robots": 2}, "takes 2 target(s), got 1"),
        ({"relation": "inside", "robots": 2}, "takes 1 target(s), got 0"),
        ({"relation": "cage", "targets": ["t1"], "robots": 2}, "3 or more"),
        ({"relation": "around", "targets": ["t1"], "robots": 0}, "robots"),
        ({"relation": "around", "targets": ["t1"], "robots": 3, "clearance": [0, 0]}, "clearance"),
        ({"relation": "around", "targets": ["t1"], "robots": 3, "clearance": [-1, 5]}, "clearance"),
        (
            {"relation": "around", "targets": ["t1"], "robots": 3, "clearance": [0, float("nan")]},
            "clearance",
        ),
        ({"relation": "around", "targets": ["t1"], "robots": 3, "clearance": [1]}, "clearance"),
        ({"relation": "along", "targets": ["t1"], "robots": 3, "edges": []}, "edges"),
        ({"relation": "along", "targets": ["t1"], "robots": 3, "edges": [-1]}, "edges"),
        ({"relation": "centre", "targets": ["t1"], "robots": 3, "clearance": [1, 2]}, "clearance"),
        ({"relation": "around", "targets": ["t1"], "robots": 3, "colour": "red"}, "colour"),
        ({"relation": "beside", "targets": ["t1"], "robots": 3}, "relation"),
    ],
)
def test_a_group_that_cannot_be_meant_is_refused_by_name(group: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match="validation error") as caught:
        Contract.model_validate({"groups": [group]})
    assert said in str(caught.value)


@pytest.mark.parametrize("group", GROUPS)
def test_contracts_survive_json_with_and_without_defaults(group: dict[str, Any]) -> None:
    contract = Contract.model_validate(
        {"groups": [group], "robot_radius": 2.25, "keep_out": ["t2"]}
    )
    full = with_defaults(contract, OUTLINES, ROOM)
    for value in (contract, full):
        assert Contract.model_validate_json(value.model_dump_json()) == value
    assert with_defaults(full, OUTLINES, ROOM) == full, "nothing is left to write out"


@pytest.mark.parametrize("group", GROUPS)
def test_defaults_leave_no_length_of_the_relation_open(group: dict[str, Any]) -> None:
    contract = Contract.model_validate({"groups": [group], "robot_radius": 3})
    full = with_defaults(contract, OUTLINES, ROOM).groups[0]
    assert full.min_spacing is not None
    assert full.min_spacing >= 6
    if full.relation in ("around", "cage", "corners", "along", "inside"):
        assert full.clearance is not None
        assert 0 <= full.clearance[0] < full.clearance[1]
    stated = {k: v for k, v in contract.groups[0] if v is not None and k != "min_spacing"}
    assert {k: getattr(full, k) for k in stated} == stated, "what was said is kept"


def test_the_aim_lies_inside_the_range_and_follows_the_fit() -> None:
    aims: list[float] = []
    for fit in ("tight", "normal", "wide"):
        group = Group(relation="around", targets=("t1",), robots=3, fit=fit)
        full = with_defaults(Contract(groups=(group,)), OUTLINES, ROOM).groups[0]
        assert full.clearance is not None
        aims.append(nominal(full.clearance))
        assert full.clearance[0] < aims[-1] < full.clearance[1]
    base = default_clearance(SQUARE, ROOM, 0)
    assert aims == pytest.approx([base * x for x in FIT_FACTOR.values()])


def test_a_spacing_below_the_robots_bodies_is_lifted_to_them() -> None:
    group = Group(relation="around", targets=("t1",), robots=3, min_spacing=1)
    full = with_defaults(Contract(groups=(group,), robot_radius=8), OUTLINES, ROOM)
    assert full.groups[0].min_spacing == 16


def test_the_json_schema_uses_no_prefix_items_and_accepts_what_pydantic_does() -> None:
    schema = Contract.model_json_schema()
    text = json.dumps(schema)
    assert "prefixItems" not in text
    Draft202012Validator.check_schema(schema)
    checker = Draft202012Validator(schema)
    for group in GROUPS:
        assert checker.is_valid({"groups": [group]}), group
    wrong: list[dict[str, Any]] = [
        {"groups": []},
        {"groups": [{"relation": "around", "targets": ["t1"]}]},
        {"groups": [GROUPS[0] | {"clearance": [1]}]},
        {"groups": [GROUPS[0] | {"clearance": [1, 2, 3]}]},
        {"groups": [GROUPS[9] | {"line": [1, 2, 3]}]},
        {"groups": [GROUPS[0] | {"robots": 0}]},
        {"groups": [GROUPS[0] | {"colour": "red"}]},
    ]
    for bad in wrong:
        assert not checker.is_valid(bad), bad


LENGTHS = st.one_of(st.just(0.0), st.floats(1e-6, 1e5))


@given(LENGTHS, LENGTHS)
@settings(derandomize=True, deadline=None, max_examples=100)
def test_nominal_lies_in_the_range_it_is_taken_from(a: float, b: float) -> None:
    least, greatest = sorted((a, b))
    assert least * (1 - 1e-9) <= nominal((least, greatest)) <= greatest * (1 + 1e-9)


@pytest.mark.parametrize("kind", ["arc", "star", "grid"])
def test_a_form_has_one_place(kind: str) -> None:
    with pytest.raises(ValidationError) as caught:
        ShapeSpec.model_validate({"kind": kind, "box": [0, 0, 9, 9], "where": "inside"})
    assert f"{kind} takes either a box, or where" in str(caught.value)
    assert f"a {kind}" not in str(caught.value)


def test_robots_at_points_take_one_each_and_nothing_else_does() -> None:
    with pytest.raises(ValidationError, match="at takes a point for each robot, got 1"):
        Group(relation="at", robots=2, points=((1, 2),))
    with pytest.raises(ValidationError, match="points belongs to at"):
        Group(relation="around", targets=("t1",), robots=1, points=((1, 2),))
    with pytest.raises(ValidationError, match="clearance does not apply to at"):
        Group(relation="at", robots=1, points=((1, 2),), clearance=(1, 2))
