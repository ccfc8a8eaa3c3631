"""A question that is open: robots move on no words before it is settled."""

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.tools.errors import InputError
from formup.tools.fleet.protocol import Motion
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt


def test_nothing_moves_at_go_while_a_question_is_open(
    drives: list[Motion],
) -> None:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    red = TargetPrompt(box=(55, 35, 125, 95))
    session = Agent().start(picture_from_array(pixels), pointed=[red])
    session.say("Surround it with 6 robots")
    asked = session.say("keep clear of the flurb")
    assert asked.report.status == "question"
    with pytest.raises(InputError, match="A question is open") as refused:
        session.say("go")
    assert refused.value.kind == "asked"
    assert session.run is asked
    assert not drives
    session.say("never mind")
    session.say("go")
    assert drives
