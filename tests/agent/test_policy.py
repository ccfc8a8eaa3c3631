"""Which calls go ahead, which wait for a person, which are refused."""

import asyncio
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.loop import Approval, run
from formup.agent.messages import Call, History, Reply, Result, User
from formup.agent.outcomes import Answered, Outcome, Paused
from formup.agent.policy import Policy
from formup.agent.wrappers.doubles import ScriptedModel
from formup.tools.builtin import TOOLS
from formup.tools.context import Context
from formup.tools.errors import InputError
from formup.tools.perception.image import picture_from_array
from formup.tools.tool import ToolResult, tool

START: History = (User(text="go"),)
PICTURE = picture_from_array(np.full((60, 80, 3), 60, np.uint8))


def call(name: str, **arguments: Any) -> Reply:
    return Reply(calls=(Call(id="c1", name=name, arguments=arguments),))


@tool("read")
def report(context: Context, number: int) -> ToolResult:
    """Repeat a number.

    Args:
        number: any.
    """
    return ToolResult({"number": number})


def go(model: ScriptedModel, *, messages: History = START, **more: Any) -> Outcome:
    return asyncio.run(run(model, (report,), Context.of(PICTURE), messages, **more))


POLICIES: list[tuple[tuple[tuple[str, Any], ...], type[Outcome]]] = [
    ((), Answered),
    ((("*", "allow"),), Answered),
    ((("report", "ask"),), Paused),
    ((("re*", "ask"), ("*", "allow")), Paused),
    ((("report", "allow"), ("*", "ask")), Answered),
    ((("REPORT", "ask"),), Answered),
]


@pytest.mark.parametrize(("rules", "ends"), POLICIES)
def test_the_first_rule_that_fits_decides(rules: Any, ends: type[Outcome]) -> None:
    script = ScriptedModel([call("report", number=1), Reply(text="x")])
    outcome = go(script, policy=Policy(rules))
    assert isinstance(outcome, ends)


def test_what_is_refused_goes_back_to_the_model() -> None:
    script = ScriptedModel([call("report", number=1), Reply(text="x")])
    outcome = go(script, policy=Policy((("report", "refuse"),)))
    result = outcome.messages[2]
    assert isinstance(result, Result)
    assert (result.error, "may not be called" in result.text) == ("refused", True)


def test_no_rule_lets_a_question_go_ahead() -> None:
    policy = Policy((("*", "allow"),))
    kinds = {t.name: policy.decide(t) for t in TOOLS}
    assert kinds["ask_user"] == "ask"
    assert kinds["propose_formation"] == "allow"


def test_a_decision_that_is_none_is_refused() -> None:
    rules: Any = (("deploy", "maybe"),)
    with pytest.raises(InputError, match="deploy=maybe"):
        Policy(rules)


def test_only_the_very_call_a_person_approved_goes_ahead() -> None:
    policy = Policy((("report", "ask"),))
    paused = go(ScriptedModel([call("report", number=1)]), policy=policy)
    assert isinstance(paused, Paused)
    other = paused.call.model_copy(update={"arguments": {"number": 2}})
    for approved, ends in ((other, Paused), (paused.call, Answered)):
        script = ScriptedModel([Reply(text="x")])
        more: dict[str, Any] = {"policy": policy, "approved": Approval(approved)}
        outcome = go(script, messages=paused.messages, **more)
        assert isinstance(outcome, ends)


def test_a_malformed_call_does_not_trouble_the_person() -> None:
    script = ScriptedModel([call("report", number="many"), Reply(text="x")])
    outcome = go(script, policy=Policy((("*", "ask"),)))
    assert isinstance(outcome, Answered)


def test_an_agent_says_yes_no_and_why() -> None:
    policy = Policy((("report", "ask"),))

    def agent() -> Agent:
        replies = [call("report", number=1), Reply(text="done")]
        return Agent(ScriptedModel(replies), tools=(report,), policy=policy)

    first = agent()
    asked = first.run(PICTURE, "count")
    assert asked.report.status == "needs_approval"
    assert 'must approve report of {"number": 1}' in asked.report.message
    with pytest.raises(InputError, match="yes or no"):
        first.resume(asked, answer="sure")
    yes = first.resume(asked, approve=True)
    assert [m.text for m in yes.outcome.messages if isinstance(m, Result)] == ['{"number":1}']
    second = agent()
    no = second.resume(second.run(PICTURE, "count"), approve=False, answer="too many")
    (result,) = [m for m in no.outcome.messages if isinstance(m, Result)]
    assert (result.error, result.text) == ("refused", "A person said no: too many")
    with pytest.raises(InputError, match="is over"):
        second.resume(no)


@pytest.mark.parametrize(
    ("refused", "words", "status"),
    [
        ("locate_object", "not looked for", "impossible"),
        ("propose_formation", "propose_formation may not be called", "impossible"),
        ("deploy", "deploy may not be called", "planned"),
        ("*", "not looked for", "impossible"),
    ],
)
def test_the_rules_do_without_what_is_refused(refused: str, words: str, status: str) -> None:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    agent = Agent(policy=Policy(((refused, "refuse"),)))
    done = agent.run(picture_from_array(pixels), "Surround the red thing with 6 robots")
    assert done.report.status == status
    assert words in done.report.message


def test_the_rules_take_no_refusal_for_an_answer() -> None:
    done = Agent(policy=Policy((("ask_user", "refuse"),))).run(PICTURE, "Surround it")
    assert isinstance(done.outcome, Answered)
    assert "How many robots?" in done.report.message
    assert "ask_user may not be called" in done.report.message
