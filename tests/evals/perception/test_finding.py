"""Things are asked for by colour, a quarter of the time by one that is not there."""

import json

import pytest
from formup.apps.cli import app
from formup.evals.perception.finding import Search, finding_table, searches
from formup.tools.errors import InputError


def test_a_quarter_of_the_searches_are_for_what_is_not_there() -> None:
    made = list(searches("photos"))
    absent = [s for s in made if not s.present]
    assert 0.25 <= len(absent) / len(made) <= 0.4
    assert not any(s.found for s in absent)


def test_recall_and_false_finds_stand_beside_each_other() -> None:
    made = [
        Search("a", "red", True, 1, True, True),
        Search("a", "blue", True, 2, True, False),
        Search("a", "grey", True, 1, False, True),
        Search("a", "pink", True, 0, False, False),
        Search("a", "green", False, 3, False, False),
        Search("a", "brown", False, 0, False, False),
    ]
    last = finding_table({"photos": made}).splitlines()[-1]
    assert last == "| photos | 4 | 0.500 | 0.250 | 0.250 | 2 | 0.500 | 0.000 |"


def test_a_suite_without_picture_files_is_refused() -> None:
    with pytest.raises(InputError, match="has a picture to search"):
        list(searches("scenes"))


def test_the_command_searches_where_no_way_of_pointing_is_named(
    capsys: pytest.CaptureFixture[str],
) -> None:
    app(["eval", "perception", "smoke", "--json"], standalone_mode=False)
    made = json.loads(capsys.readouterr().out)["searches"]["smoke"]
    assert {s["present"] for s in made} == {True, False}
