"""The loop with scripted and function models on a real picture with real tools."""

import asyncio
import json
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.limits import Limits
from formup.agent.loop import Approval, Recorder, run
from formup.agent.messages import HISTORY, Call, History, Message, Reply, Result, User, unanswered
from formup.agent.model import Request
from formup.agent.outcomes import Answered, Cancelled, Outcome, Paused, Stopped
from formup.agent.policy import Policy
from formup.agent.wrappers.doubles import FunctionModel, ScriptedModel
from formup.tools.builtin import TOOLS
from formup.tools.context import Context, Settings
from formup.tools.errors import ModelError
from formup.tools.perception.image import picture_from_array
from formup.tools.world import World

START: History = (User(text="go"),)
ALONG: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
    "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
}


def context(**settings: Any) -> Context:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    return Context.of(picture_from_array(pixels), Settings(**settings))


def call(name: str, arguments: dict[str, Any] | None = None, id: str = "c1") -> Reply:
    return Reply(calls=(Call(id=id, name=name, arguments=arguments or {}),))


def go(model: ScriptedModel | FunctionModel, messages: History = START, **more: Any) -> Outcome:
    work = more.pop("work", None) or context()
    return asyncio.run(run(model, TOOLS, work, messages, **more))


def test_a_reply_without_calls_is_the_answer() -> None:
    model = ScriptedModel([Reply(text="done")])
    outcome = go(model)
    assert isinstance(outcome, Answered)
    assert outcome.text == "done"
    assert outcome.messages == (*START, Reply(text="done"))
    model.assert_complete()


def test_the_model_sees_prompt_history_and_tools() -> None:
    model = ScriptedModel([Reply(text="done")])
    go(model, system="be brief")
    assert model.requests == [Request("be brief", START, TOOLS)]


def test_calls_run_in_order_and_results_come_back() -> None:
    both = Reply(
        calls=(
            Call(id="a", name="segment", arguments={"box": [55, 35, 125, 95]}),
            Call(id="b", name="describe_shape", arguments={"target": "t1"}),
        )
    )
    outcome = go(ScriptedModel([both, Reply(text="done")]))
    results = [m for m in outcome.messages if isinstance(m, Result)]
    assert [r.call_id for r in results] == ["a", "b"]
    assert all(r.error is None for r in results)
    assert json.loads(results[1].text)["length_px"] == pytest.approx(60, abs=4)


def test_unknown_tool_goes_back_with_the_names_there_are() -> None:
    outcome = go(ScriptedModel([call("fly"), Reply(text="sorry")]))
    result = outcome.messages[2]
    assert isinstance(result, Result)
    assert result.error == "unknown_tool"
    assert "'fly'" in result.text
    assert "propose_formation" in result.text


def test_all_argument_mistakes_go_back_at_once() -> None:
    wrong = {"target": 7, "n": 0, "side": "north", "extra": 1}
    outcome = go(ScriptedModel([call("sample_along_edges", wrong), Reply(text="sorry")]))
    result = outcome.messages[2]
    assert isinstance(result, Result)
    assert result.error == "arguments"
    for word in ("target", "n", "side", "extra"):
        assert f"{word}:" in result.text


def test_what_a_tool_cannot_do_goes_back() -> None:
    outcome = go(ScriptedModel([call("describe_shape", {"target": "t9"}), Reply(text="sorry")]))
    result = outcome.messages[2]
    assert isinstance(result, Result)
    assert (result.error, "'t9'" in result.text) == ("tool", True)


def test_our_own_bugs_are_not_hidden() -> None:
    def broken(request: Request) -> Reply:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        go(FunctionModel(broken))


def test_the_same_failing_call_twice_stops_the_run() -> None:
    replies = [call("fly", id="a"), call("fly", id="b"), Reply(text="never")]
    outcome = go(ScriptedModel(replies))
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "repeat"
    assert "fly" in outcome.reason


def test_a_failing_call_mended_goes_on() -> None:
    replies = [
        call("check_point", {"target": "t1", "points": [[1, 1]]}, "a"),
        call("segment", {"box": [55, 35, 125, 95]}, "b"),
        call("check_point", {"target": "t1", "points": [[1, 1]]}, "c"),
        Reply(text="done"),
    ]
    model = ScriptedModel(replies)
    assert isinstance(go(model), Answered)
    model.assert_complete()


def test_a_limit_is_an_outcome_that_keeps_the_messages() -> None:
    def ever(request: Request) -> Reply:
        return call("locate_object", id=f"c{len(request.messages)}")

    outcome = go(FunctionModel(ever), limits=Limits(requests=2))
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "limit"
    assert "2 requests" in outcome.reason
    assert len(outcome.messages) == 1 + 2 * 2
    many = go(FunctionModel(ever), limits=Limits(tool_calls=2))
    assert isinstance(many, Stopped)
    assert "2 tool calls" in many.reason


def test_a_failing_model_keeps_the_messages() -> None:
    outcome = go(ScriptedModel([call("locate_object")]))
    assert isinstance(outcome, Stopped)
    assert outcome.kind == "model"
    assert len(outcome.messages) == 3


def test_a_question_pauses_and_its_answer_resumes_in_another_process() -> None:
    asked = go(ScriptedModel([call("ask_user", {"question": "Which one?"})]))
    assert isinstance(asked, Paused)
    assert asked.call.arguments["question"] == "Which one?"
    history = HISTORY.validate_json(HISTORY.dump_json(asked.messages))
    assert history == asked.messages
    assert unanswered(history) == (asked.call,)
    answer = Result(call_id=asked.call.id, name="ask_user", text="the red one")
    resumed = go(ScriptedModel([Reply(text="thanks")]), (*history, answer))
    assert isinstance(resumed, Answered)


def test_a_malformed_question_does_not_trouble_the_person() -> None:
    outcome = go(ScriptedModel([call("ask_user", {}), Reply(text="sorry")]))
    assert isinstance(outcome, Answered)
    result = outcome.messages[2]
    assert isinstance(result, Result)
    assert "question: is missing" in result.text


def test_robots_that_need_leave_wait_for_it_and_then_move() -> None:
    work = context()
    proposed = go(ScriptedModel([call("propose_formation", ALONG), Reply(text="ok")]), work=work)
    assert isinstance(proposed, Answered)
    (plan_id,) = proposed.world.plans
    work = work.at(proposed.world)
    replies = [call("deploy", {"plan_id": plan_id}, "d"), Reply(text="there")]
    paused = go(ScriptedModel(replies[:1]), work=work, policy=Policy((("deploy", "ask"),)))
    assert isinstance(paused, Paused)
    assert paused.call.name == "deploy"
    assert paused.plan_id == plan_id
    assert not paused.world.arrivals
    policy = Policy((("*", "ask"),))
    approved = Approval(paused.call, paused.plan_id)
    work = work.at(paused.world)
    moved = go(
        ScriptedModel(replies[1:]), paused.messages, work=work, policy=policy, approved=approved
    )
    assert isinstance(moved, Answered)
    assert moved.world.arrivals[plan_id].arrived


def test_report_impossible_ends_the_run() -> None:
    outcome = go(ScriptedModel([call("report_impossible", {"reason": "it is too small"})]))
    assert isinstance(outcome, Answered)
    assert "too small" in outcome.text


def test_cancelling_keeps_the_messages() -> None:
    async def scenario() -> Outcome:
        started = asyncio.Event()

        class Slow:
            name = "slow"

            async def reply(self, request: Request) -> Reply:
                if len(request.messages) > 1:
                    started.set()
                    await asyncio.sleep(60)
                return call("locate_object")

        task = asyncio.create_task(run(Slow(), TOOLS, context(), START))
        await started.wait()
        task.cancel()
        return await task

    outcome = asyncio.run(scenario())
    assert isinstance(outcome, Cancelled)
    assert len(outcome.messages) == 3


class Recorded(Recorder):
    """Keeps what a recorder is given, and what was known then."""

    def __init__(self) -> None:
        self.given: list[tuple[Message, World]] = []
        self.moves: list[tuple[str, World]] = []

    async def message(self, message: Message, world: World) -> None:
        self.given.append((message, world))

    async def moving(self, plan_id: str, world: World) -> None:
        self.moves.append((plan_id, world))


def test_every_new_message_is_recorded_once_in_order_with_its_world() -> None:
    recorder = Recorded()
    replies = [call("locate_object"), call("propose_formation", ALONG, "c2"), Reply(text="x")]
    outcome = go(ScriptedModel(replies), recorder=recorder)
    assert (*START, *(m for m, _ in recorder.given)) == outcome.messages
    assert [len(w.plans) for _, w in recorder.given] == [0, 0, 0, 1, 1]
    assert recorder.given[-1][1] is outcome.world
    assert recorder.moves == []


def test_unused_script_fails() -> None:
    model = ScriptedModel([Reply(text="a"), Reply(text="b")])
    go(model)
    with pytest.raises(AssertionError, match="1 of 2"):
        model.assert_complete()


def test_a_script_that_runs_out_is_a_model_error() -> None:
    with pytest.raises(ModelError):
        asyncio.run(ScriptedModel([]).reply(Request("", START, ())))


def test_the_synchronous_door_works_in_an_event_loop_too() -> None:
    picture = context().picture

    async def notebook() -> str:
        said = ScriptedModel([Reply(text="Hello.")])
        return Agent(said).run(picture, "Surround it").report.message

    assert asyncio.run(notebook()) == "Hello."


PROPOSE = Call(id="p", name="propose_formation", arguments=ALONG)


def test_a_clear_case_is_one_reply() -> None:
    deploy = Call(id="d", name="deploy", arguments={"tell": "They stand around it."})
    model = ScriptedModel([Reply(calls=(PROPOSE, deploy))])
    outcome = go(model)
    assert isinstance(outcome, Answered)
    assert outcome.text.startswith("They stand around it. All 6 robots were observed within")
    last = outcome.messages[-1]
    assert isinstance(last, Result)
    assert last.message == outcome.text
    assert len(outcome.world.arrivals) == 1
    model.assert_complete()


def test_robots_are_not_moved_when_a_call_before_it_failed() -> None:
    """Not even to a sound plan of an earlier reply; and saying so twice is no repetition."""
    bad = Call(id="b", name="propose_formation", arguments={"contract": {"groups": []}})
    deploys = [Call(id=f"d{i}", name="deploy", arguments={"tell": "done"}) for i in range(3)]
    worse = Call(id="w", name="propose_formation", arguments={"contract": {}})
    replies = [
        Reply(calls=(PROPOSE,)),
        Reply(calls=(bad, deploys[0])),
        Reply(calls=(worse, deploys[1])),
        Reply(text="I give up."),
    ]
    outcome = go(ScriptedModel(replies))
    assert isinstance(outcome, Answered)
    assert outcome.text == "I give up."
    skipped = [m for m in outcome.messages if isinstance(m, Result) and m.name == "deploy"]
    assert [m.error for m in skipped] == ["skipped", "skipped"]
    assert "because propose_formation before it failed" in skipped[0].text
    assert outcome.world.arrivals == {}


def test_a_failure_in_an_earlier_reply_does_not_hold_robots_back() -> None:
    wrong = Call(id="w", name="look", arguments={"region": [9, 9, 3, 3]})
    deploy = Call(id="d", name="deploy", arguments={})
    replies = [Reply(calls=(wrong,)), Reply(calls=(PROPOSE, deploy)), Reply(text="done")]
    outcome = go(ScriptedModel(replies))
    assert len(outcome.world.arrivals) == 1


def test_a_person_is_not_asked_about_a_move_that_is_not_made() -> None:
    bad = Call(id="b", name="propose_formation", arguments={})
    deploy = Call(id="d", name="deploy", arguments={"tell": "done"})
    policy = Policy((("deploy", "ask"),))
    outcome = go(ScriptedModel([Reply(calls=(bad, deploy)), Reply(text="no")]), policy=policy)
    assert isinstance(outcome, Answered)


def test_approval_of_a_plan_of_the_same_reply() -> None:
    deploy = Call(id="d", name="deploy", arguments={"tell": "They stand."})
    policy = Policy((("deploy", "ask"),))
    paused = go(ScriptedModel([Reply(calls=(PROPOSE, deploy))]), policy=policy)
    assert isinstance(paused, Paused)
    assert paused.call == deploy
    assert [paused.plan_id] == list(paused.world.plans)
    assert paused.world.arrivals == {}
    done = go(
        ScriptedModel([]),
        paused.messages,
        work=context().at(paused.world),
        policy=policy,
        approved=Approval(deploy, paused.plan_id),
    )
    assert isinstance(done, Answered)
    assert list(done.world.arrivals) == list(done.world.plans)


def test_what_is_not_offered_is_still_known() -> None:
    offered = tuple(t for t in TOOLS if t.name == "deploy")
    replies = [call("look"), Reply(text="done")]
    model = ScriptedModel(replies)
    outcome = go(model, offered=offered)
    assert [r.tools for r in model.requests] == [offered, offered]
    result = outcome.messages[2]
    assert isinstance(result, Result)
    assert result.error is None


def test_pictures_that_come_with_an_error_reach_the_model() -> None:
    segment = call("segment", {"box": [55, 35, 125, 95]})
    work = context(threshold=1.0)
    outcome = go(ScriptedModel([segment, Reply(text="hm")]), work=work)
    result = outcome.messages[2]
    assert isinstance(result, Result)
    assert result.error == "tool"
    assert len(result.images) == 1
