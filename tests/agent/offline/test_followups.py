"""Follow-ups as operators type them to the edits, answers and questions that they mean."""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from formup.agent.offline.followup import Followup
from formup.agent.offline.followup_words import rules
from formup.agent.offline.followups import read_followup
from formup.agent.offline.standing import Standing
from formup.tools.formation.editing.edit_kinds import Edit
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

EDIT: TypeAdapter[Any] = TypeAdapter(Edit)
TABLE = yaml.safe_load(Path(__file__).with_name("followups.yaml").read_text("utf-8"))
ROWS = [(scene, *row) for scene, rows in TABLE["rows"].items() for row in rows]
MEANT = [row for row in ROWS if isinstance(row[2], dict) and "talk" not in row[2]]
UNKNOWN = "zorvel"
"""A word of no list: it is never left out."""


@cache
def standing(scene: str) -> Standing:
    """What stands in a scene of the table."""
    given = dict(TABLE["scenes"][scene])
    count, groups = given.pop("robots"), given.pop("groups")
    things = tuple((name, label) for name, label in given.pop("things"))
    for name in ("edits", "pointed", "place", "size", "apart"):
        if name in given:
            given[name] = tuple(given[name])
    given["centre"] = {name: tuple(at) for name, at in given["centre"].items()}
    if "places" in given:
        given["places"] = {str(name): tuple(at) for name, at in given["places"].items()}
    robots = tuple(str(k + 1) for k in range(count))
    return Standing(contract={"groups": groups}, robots=robots, things=things, **given)


def read(scene: str, words: str) -> dict[str, Any] | str:
    """What is read, in the form of the table."""
    followup = read_followup(words, standing(scene))
    if followup.kind in ("ask", "refuse", "instruction"):
        return followup.kind
    if followup.kind == "talk":
        return {"talk": followup.about}
    names = ("undo", "to", "edits", "stay", "go", "hold", "query", "rest")
    found = {name: getattr(followup, name) for name in names}
    return {name: _plain(value) for name, value in found.items() if value}


def _plain(value: Any) -> Any:
    return json.loads(json.dumps(value))


@pytest.mark.parametrize(("scene", "words", "meant"), ROWS)
def test_what_is_meant(scene: str, words: str, meant: dict[str, Any] | str) -> None:
    assert read(scene, words) == meant


def test_there_are_enough_of_each_kind() -> None:
    quiet = [row for row in ROWS if row not in MEANT or {"query", "hold"} & set(row[2])]
    assert len(ROWS) >= 500
    assert len(quiet) >= 150
    said = {edit["kind"] for row in MEANT for edit in row[2].get("edits", ())}
    models = get_args(get_args(Edit)[0])
    assert said == {k for m in models for k in get_args(m.model_fields["kind"].annotation)}


@pytest.mark.parametrize(("scene", "words", "meant"), MEANT)
def test_edits_are_ones_that_the_tool_takes(scene: str, words: str, meant: dict[str, Any]) -> None:
    for edit in read_followup(words, standing(scene)).edits:
        way = edit.get("by")
        EDIT.validate_python(edit | ({"by": [1.0, 1.0]} if isinstance(way, dict) else {}))


@pytest.mark.parametrize(("scene", "words", "meant"), MEANT)
def test_an_unknown_word_is_never_left_out(scene: str, words: str, meant: dict[str, Any]) -> None:
    spoken = words.split()
    for at in {0, len(spoken) // 2, len(spoken)}:
        more = " ".join([*spoken[:at], UNKNOWN, *spoken[at:]])
        followup = read_followup(more, standing(scene))
        kept = UNKNOWN in repr(followup)
        assert kept or followup.kind in ("ask", "refuse"), more


@pytest.mark.parametrize(("scene", "words", "meant"), [r for r in ROWS if r[2] == "ask"])
def test_options_answer_the_question(scene: str, words: str, meant: str) -> None:
    for option in read_followup(words, standing(scene)).options:
        assert read_followup(option, standing(scene)).kind not in ("ask", "refuse"), option


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ("go", "go"),
        ("undo", "refuse"),
        ("thanks", "talk"),
        ("what can you do", "talk"),
        ("further out", "refuse"),
        ("robot 3 left", "refuse"),
        ("surround the coin with 6 robots", "instruction"),
        ("fill it", "instruction"),
    ],
)
def test_what_fits_when_no_plan_stands(words: str, kind: str) -> None:
    assert read_followup(words, None).kind == kind


@pytest.mark.parametrize(("scene", "words", "meant"), ROWS)
def test_nothing_is_changed_where_no_plan_stands(scene: str, words: str, meant: object) -> None:
    followup = read_followup(words, None)
    assert not followup.edits
    assert followup.kind not in ("edits", "undo", "query")


def test_what_is_not_understood_is_quoted() -> None:
    followup = read_followup("further out and paint it red", standing("first"))
    assert isinstance(followup, Followup)
    assert '"further out" is clear' in followup.text
    assert '"paint"' in followup.text
    assert followup.options == ("further out",)


SALAD = st.lists(st.sampled_from(sorted({*re.findall(r"[a-z']+|[0-9]+", repr(rules()).lower())})))


@settings(deadline=None, max_examples=150)
@given(SALAD.map(" ".join), st.sampled_from(sorted(TABLE["scenes"])))
def test_any_words_of_the_rules_are_read_without_a_crash(words: str, scene: str) -> None:
    for followup in (read_followup(words, standing(scene)), read_followup(words, None)):
        assert followup.text or followup.kind not in ("ask", "refuse")
