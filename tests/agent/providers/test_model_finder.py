"""The model that decides as a detector: over HTTP in four interfaces, and replayed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Result
from formup.agent.wrappers.replay import ReplayModel
from formup.tools.context import Settings
from formup.tools.perception.image import Picture, picture_from_array

Say = Callable[..., bytes]
VLM = Settings(detector="vlm", may_deploy=False)
CONTRACT = {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]}
SEGMENT = [("c1", "segment", {"id": "t1", "text": "the mug"})]
BOX = [58.0, 38, 121, 91]


@pytest.fixture(scope="module")
def picture() -> Picture:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    pixels[20:60, 150:190] = (40, 40, 200)
    return picture_from_array(pixels)


def found(*things: tuple[list[float], float]) -> str:
    return json.dumps({"things": [{"box": box, "score": score} for box, score in things]})


def segmented(run: Any) -> Result:
    (result,) = (m for m in run.outcome.messages if isinstance(m, Result) and m.name == "segment")
    return result


def test_its_boxes_are_measured_counted_shown_to_nobody_and_replayed(
    server: Any, dialect: Any, say: Say, streamed: bool, picture: Picture, tmp_path: Path
) -> None:
    propose = [("c2", "propose_formation", {"contract": CONTRACT})]
    server.script = [
        say("I look.", SEGMENT, "calls"),
        say(f"```json\n{found((BOX, 0.9))}\n```"),
        say("", propose, "calls"),
        say("Done."),
    ]
    agent, trace = Agent(server.model(dialect.name, streamed=streamed)), tmp_path / "trace.jsonl"
    run = agent.run(picture, "Surround the mug with 6 robots", settings=VLM, trace=trace)
    report = run.report
    assert report.status == "planned"
    assert (report.usage.requests, report.usage.tool_calls) == (4, 2)
    assert (report.usage.input_tokens, report.usage.output_tokens) == (400, 80)
    assert report.targets is not None
    assert report.targets[0]["confidence"] == 0.65
    assert segmented(run).images, "what is so unsure is looked at"
    assert "".join(server.shown) == ("I look.Done." if streamed else "")
    first, aside = (json.dumps(body) for body in server.requests[:2])
    assert "Nouns are found" in first
    assert "tools" not in server.requests[1]
    assert "propose_formation" not in aside
    assert "image" in aside
    assert "Find: " in aside
    again = Agent(ReplayModel(trace)).run(picture, "Surround the mug with 6 robots", settings=VLM)
    assert again.report.plan_id == report.plan_id
    assert again.report.usage.requests == 4


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (found(), 'No things were found as "mug"'),
        (found((BOX, 0.9), ([148, 18, 192, 62], 0.8)), '2 things were found as "mug": c1, c2'),
        (found((BOX, 0.9), ([900, 20, 990, 60], 0.8)), '"confidence":0.65'),
        (found(([40, 38, 900, 91], 0.3)), "ask the person whether the outline shown is right"),
        (found(([900, 20, 990, 60], 0.8), ([9, 9, 2, 2], 0.8)), "none in this picture"),
        ("It is at the left.", "in no form that can be read"),
        (found((BOX, 9)), "in no form that can be read"),
        ('{"things": [{"box": [1, 2, 3], "score": 0.5}]}', "in no form that can be read"),
    ],
)
def test_what_it_says_is_a_proposal_and_may_be_no_use(
    server: Any, openai: Any, http: Any, picture: Picture, said: str, told: str
) -> None:
    asked, last = openai.body("", SEGMENT, "calls"), openai.body("I cannot.")
    server.script = [http.response(body) for body in (asked, openai.body(said), last)]
    run = Agent(server.model("openai")).run(picture, "Surround the mug", settings=VLM)
    assert told in segmented(run).text
    assert run.report.usage.requests == 3


def test_a_provider_that_fails_there_ends_the_turn(
    server: Any, openai: Any, http: Any, picture: Picture
) -> None:
    asked = openai.body("", SEGMENT, "calls")
    server.script = [http.response(asked), http.response(openai.error("no"), 400)]
    run = Agent(server.model("openai")).run(picture, "Surround the mug", settings=VLM)
    assert run.report.status == "failed"
