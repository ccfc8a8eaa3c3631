"""What an arrangement is for, where that demands something of it."""

from typing import Any

import pytest
from formup.agent.offline.accounting import read_instruction

PROOF = {"closure": "escape-proof"}


@pytest.mark.parametrize(
    ("words", "relation", "fields"),
    [
        ("Pen the goat in with 9 robots so it can never get out", "cage", PROOF),
        ("Ring the drain with 9 robots, nothing may slip through between them", "cage", PROOF),
        ("9 robots round the crab so that it has no way to escape", "cage", PROOF),
        ("9 robots round the crab so nobody gets at it", "cage", {}),
        ("9 robots round the tent such that they hug it", "around", {"fit": "tight"}),
        ("9 robots round the tent so that they stay well away from it", "around", {"fit": "wide"}),
        ("9 robots round the tent, it leans so far", "around", {}),
        ("We had a crab that could not get out. Ring the drain with 9 robots", "around", {}),
    ],
)
def test_purposes_demand_what_they_say(words: str, relation: str, fields: dict[str, Any]) -> None:
    reading = read_instruction(words)
    assert (reading.relation, reading.robots, reading.group) == (relation, 9, fields)
    assert len(reading.things) == 1
    assert "such" not in reading.things[0]
