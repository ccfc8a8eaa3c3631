"""Two models share a run: one sees and says what is meant, the other plans without a picture."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply, Result, User
from formup.agent.model import Request
from formup.agent.outcomes import Answered, Paused
from formup.agent.session import load_run
from formup.agent.store.folder import read_events
from formup.agent.wrappers.doubles import ScriptedModel
from formup.prompts import load_prompt
from formup.tools.context import Settings
from formup.tools.errors import InputError
from formup.tools.perception.image import Picture, load_picture, picture_from_array
from PIL import Image

PI = "Surround t1 evenly with 6 robots."
BOX = [55, 35, 125, 95]


class Seer(ScriptedModel):
    """A scripted model that reads a prompt, and the picture."""

    prompt = "former"
    sees = True


def call(name: str, of: str, **arguments: Any) -> Call:
    return Call(id=of, name=name, arguments=arguments)


SEGMENT = Reply(text=PI, calls=(call("segment", "s", id="t1", label="the box", box=BOX),))
GROUP = {"relation": "around", "targets": ["t1"], "robots": 6}
PROPOSE = call("propose_formation", "p", contract={"groups": [GROUP]})
DEPLOY = call("deploy", "d", tell="Six stand around it.")
PLACE = Reply(calls=(PROPOSE, DEPLOY))


@pytest.fixture
def picture(tmp_path: Path) -> Picture:
    pixels = np.full((140, 200, 3), 90, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "box.png")
    return load_picture(tmp_path / "box.png")


def texts(request: Request) -> str:
    return json.dumps([m.model_dump(mode="json") for m in request.messages])


def pictures(request: Request) -> int:
    return sum(len(m.images) for m in request.messages if isinstance(m, User | Result))


def test_the_looker_sees_and_the_planner_is_told(picture: Picture) -> None:
    looker, planner = Seer([SEGMENT], "look:er"), Seer([PLACE], "plan:ner")
    made = Agent(looker, planner=planner).run(picture, "Put six around the odd one")
    report = made.report
    assert (report.status, report.model) == ("deployed", "look:er+plan:ner")
    looker.assert_complete()
    planner.assert_complete()
    (looked,), (planned,) = looker.requests, planner.requests
    assert looked.system == load_prompt("context").text
    assert planned.system == load_prompt("planner").text
    assert pictures(looked) == 1
    assert pictures(planned) == 0
    (told,) = planned.messages
    assert isinstance(told, User)
    assert told.text.startswith('Instruction: "Put six around the odd one"')
    assert f'Pattern: "{PI}"' in told.text
    assert 'Measured: [{"id":"t1","label":"the box"' in told.text
    assert {t.name for t in looked.tools} == set(load_prompt("context").tools)
    assert {t.name for t in planned.tools} == set(load_prompt("planner").tools)
    assert [p["id"] for p in report.prompts] == ["context", "planner", "repair", "revise"]
    assert report.prompt == report.prompts[1]


def test_the_looker_goes_on_until_all_is_measured(picture: Picture) -> None:
    wrong = Reply(text=PI, calls=(call("segment", "a", box=[9, 9, 3, 3]),))
    peek = Reply(calls=(call("look", "b", region=BOX),))
    half = Reply(
        text=PI,
        calls=(call("segment", "c", id="t1", box=BOX), call("segment", "d", box=[8, 9, 3, 3])),
    )
    looker, planner = Seer([wrong, peek, half, SEGMENT]), Seer([PLACE])
    assert Agent(looker, planner=planner).run(picture, "Six around it").report.exit_code == 0
    looker.assert_complete()
    planner.assert_complete()
    assert [pictures(r) for r in looker.requests] == [1, 1, 2, 2]


def test_what_is_not_certified_is_repaired_under_a_prompt_of_its_own(picture: Picture) -> None:
    crowded = call("propose_formation", "x", contract={"groups": [GROUP]}, positions=[[5, 5]] * 6)
    refused = call("propose_formation", "y", contract={"groups": [GROUP | {"targets": ["t9"]}]})
    script = [Reply(calls=(crowded, DEPLOY)), Reply(calls=(refused,)), PLACE]
    planner = Seer(script)
    agent = Agent(Seer([SEGMENT]), planner=planner, prompt="former-direct@v001")
    assert agent.run(picture, "Six around it").report.status == "deployed"
    direct, repair = load_prompt("former-direct@v001").text, load_prompt("repair").text
    assert [r.system for r in planner.requests] == [direct, repair, repair]


def test_a_question_of_the_looker_is_answered_in_another_process(
    picture: Picture, tmp_path: Path
) -> None:
    ask = Reply(calls=(call("ask_user", "q", question="Which one?"),))
    asked = Agent(Seer([ask]), planner=Seer([])).run(
        picture, "Six around it", trace=tmp_path / "trace.jsonl"
    )
    assert isinstance(asked.outcome, Paused)
    left = load_run(tmp_path)
    assert left.report.model == "scripted+scripted"
    assert [p["id"] for p in left.report.prompts] == ["context", "planner", "repair", "revise"]
    agent = Agent(Seer([SEGMENT]), planner=Seer([PLACE]))
    assert agent.resume(left, answer="the red one").report.status == "deployed"
    start = read_events(tmp_path)[0].data
    assert (start["model"], start["planner"]) == ("scripted", "scripted")


def test_a_run_of_two_is_replayed_by_one(picture: Picture, tmp_path: Path) -> None:
    trace = tmp_path / "trace.jsonl"
    agent = Agent(Seer([SEGMENT], "a"), planner=Seer([PLACE], "b"))
    done = agent.run(picture, "Six around it", trace=trace)
    again = Agent(f"replay:{trace}").run(picture, "Six around it")
    assert isinstance(again.outcome, Answered)
    assert again.outcome.messages == done.outcome.messages
    assert again.report.model == "a+b"
    assert again.report.positions == done.report.positions


OUT = call("edit_formation", "e", edits=[{"kind": "out", "factor": 1.25}], tell="Further out.")
STAY = Settings(may_deploy=False)
BLUE = [135, 85, 190, 130]


@pytest.fixture
def two(tmp_path: Path) -> Picture:
    """A red box and a blue one."""
    pixels = np.full((140, 200, 3), 90, np.uint8)
    pixels[40:80, 30:80] = (200, 40, 40)
    pixels[92:122, 142:182] = (40, 60, 210)
    Image.fromarray(pixels).save(tmp_path / "two.png")
    return load_picture(tmp_path / "two.png")


def test_the_planner_changes_what_stands_and_goes_back_without_the_looker(
    picture: Picture, tmp_path: Path
) -> None:
    looker = Seer([SEGMENT])
    planner = Seer([PLACE, Reply(calls=(OUT,)), Reply(calls=(call("undo", "u", tell="Back."),))])
    agent = Agent(looker, planner=planner)
    first = agent.run(picture, "Six around it", trace=tmp_path / "trace.jsonl")
    out = agent.say(first, "a bit further out", settings=STAY)
    back = agent.say(out, "undo that", settings=STAY)
    looker.assert_complete()
    planner.assert_complete()
    assert [r.report.status for r in (first, out, back)] == ["deployed", "planned", "planned"]
    assert out.report.parent == back.report.plan_id == first.report.plan_id
    assert out.report.message.startswith("Further out.")
    asked = planner.requests[1]
    assert asked.system == load_prompt("revise").text
    assert {t.name for t in asked.tools} == set(load_prompt("revise").tools)
    (told,) = asked.messages
    assert f'Standing: {{"plan": "{first.report.plan_id}"' in told.text
    left = load_run(tmp_path)
    assert left.outcome == back.outcome
    replayed = Agent(f"replay:{tmp_path / 'trace.jsonl'}")
    again = replayed.run(picture, "Six around it")
    for words in ("a bit further out", "undo that"):
        again = replayed.say(again, words, settings=STAY)
    assert again.outcome.messages == back.outcome.messages


def test_the_planner_has_the_looker_measure_what_is_new(two: Picture) -> None:
    red = Reply(text=PI, calls=(call("segment", "s", id="t1", box=[25, 35, 85, 85]),))
    blue = Reply(text="Half of them move to t2.", calls=(call("segment", "b", id="t2", box=BLUE),))
    edit = {"kind": "target", "to": "t2", "robots": 3}
    moved = Reply(calls=(call("edit_formation", "e", edits=[edit], tell="Three and three."),))
    look = Reply(text="I cannot see it.", calls=(call("look", "l"),))
    looker, planner = Seer([red, blue]), Seer([PLACE, look, moved])
    agent = Agent(looker, planner=planner)
    first = agent.run(two, "Six around the red one")
    done = agent.say(first, "half of them around the blue one", settings=STAY)
    looker.assert_complete()
    planner.assert_complete()
    assert (done.report.status, done.report.parent) == ("planned", first.report.plan_id)
    assert done.report.contract is not None
    groups = [(g.targets, g.robots) for g in done.report.contract.groups]
    assert groups == [(("t1",), 3), (("t2",), 3)]
    assert looker.requests[1].system == load_prompt("context").text
    assert pictures(looker.requests[1]) == 2
    (told,) = planner.requests[2].messages
    assert isinstance(told, User)
    assert 'Pattern: "Half of them move to t2."' in told.text
    assert "Standing: {" in told.text and 'Measured: [{"id":"t2"' in told.text
    assert "I cannot see it." not in texts(planner.requests[2])
    assert [pictures(r) for r in planner.requests] == [0, 0, 0]
    assert planner.requests[2].system == load_prompt("revise").text


def test_where_no_plan_stands_the_looker_begins(picture: Picture) -> None:
    looker = Seer([Reply(text="I see a red box."), SEGMENT])
    planner = Seer([PLACE])
    agent = Agent(looker, planner=planner)
    first = agent.run(picture, "What do you see?")
    assert agent.say(first, "Six around it").report.status == "deployed"
    assert planner.requests[0].system == load_prompt("planner").text


def test_rules_cannot_share_the_work(picture: Picture) -> None:
    with pytest.raises(InputError, match="offline reads no prompt"):
        Agent("offline", planner=Seer([]))
    with pytest.raises(InputError, match="offline reads no prompt"):
        Agent(Seer([]), planner="offline")


def test_a_model_that_sees_gets_the_picture_and_others_do_not() -> None:
    made = picture_from_array(np.full((1000, 2048, 3), 90, np.uint8))
    seer, blind = Seer([Reply(text="no")]), ScriptedModel([Reply(text="no")])
    Agent(seer).run(made, "Surround it")
    Agent(blind).run(made, "Surround it")
    assert [pictures(m.requests[0]) for m in (seer, blind)] == [1, 0]
    assert 'shown at 0.5 times its size: read the rulers"' in texts(seer.requests[0]).replace(
        "\\", ""
    )
    assert "shown at" not in texts(blind.requests[0])
