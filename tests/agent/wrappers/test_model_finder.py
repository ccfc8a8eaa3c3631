"""Asking a model from within a tool: who may be asked, and what is given up with the tool."""

import asyncio
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.limits import Limits
from formup.agent.messages import Call, Reply, Result
from formup.agent.model import Request
from formup.agent.wrappers.two_stages import TwoStages
from formup.prompts import load_prompt
from formup.tools.context import Settings
from formup.tools.errors import InputError
from formup.tools.perception.image import Picture

VLM = Settings(detector="standout+vlm", may_deploy=False)
SEGMENT = Call(id="s", name="segment", arguments={"text": "mug"})


class Slow:
    """Calls `segment` by words, and never says where the thing is."""

    name, sees = "slow", True

    def __init__(self) -> None:
        self.given_up = False

    async def reply(self, request: Request) -> Reply:
        if not request.aside:
            return Reply(text="ok") if len(request.messages) > 1 else Reply(calls=(SEGMENT,))
        try:
            await asyncio.sleep(60)
        except asyncio.CancelledError:
            self.given_up = True
            raise
        raise AssertionError


@pytest.mark.parametrize(
    ("limits", "status"),
    [(Limits(tool_seconds=3.0), "impossible"), (Limits(seconds=3.0), "stopped")],
    ids=["tool", "turn"],
)
def test_a_tool_that_is_given_up_gives_up_its_request(
    red_box: Picture, limits: Limits, status: str
) -> None:
    model = Slow()
    agent = Agent(model, limits=limits)
    run = agent.run(red_box, "Surround the mug with 4 robots", settings=VLM)
    assert model.given_up
    assert run.report.status == status


def test_a_reply_that_takes_too_long_is_the_models_failure(red_box: Picture) -> None:
    run = Agent(Slow(), limits=Limits(reply_seconds=0.3)).run(red_box, "Surround it", settings=VLM)
    assert "did not finish a reply within 0.3 s" in run.report.message


@pytest.mark.parametrize("detector", ["vlm", "standout+vlm"])
def test_who_does_not_see_cannot_be_asked(red_box: Picture, detector: str) -> None:
    with pytest.raises(InputError, match="offline sees no picture; choose a model such as"):
        Agent().run(red_box, "Surround it", settings=Settings(detector=detector))


def test_of_two_models_the_one_that_sees_is_asked() -> None:
    class Fixed:
        def __init__(self, name: str) -> None:
            self.name = name

        async def reply(self, request: Request) -> Reply:
            return Reply(text=self.name)

    prompts: dict[str, Any] = dict.fromkeys(
        ("look", "plan", "repair", "revise"), load_prompt("find")
    )
    both = TwoStages(Fixed("looker"), Fixed("planner"), **prompts)
    assert asyncio.run(both.reply(Request("", (), (), aside=True))).text == "looker"


def test_outside_of_its_turns_what_it_found_is_still_known(red_box: Picture) -> None:
    class Sees(Slow):
        async def reply(self, request: Request) -> Reply:
            if request.aside:
                self.given_up = True
                return Reply(text='{"things": [{"box": [58, 38, 121, 91], "score": 0.9}]}')
            return await super().reply(request)

    run = Agent(Sees()).run(red_box, "Surround the mug", settings=VLM)
    (result,) = (m for m in run.outcome.messages if isinstance(m, Result))
    assert len(result.asides) == 1
    assert run.report.usage.requests == 3
    named = [c for c in run.context.candidates() if c.as_named("mug")]
    assert [c.id for c in named] == ["c1"]
    again = Agent(Sees()).run(red_box, "Surround the mug", settings=VLM)
    assert again.report.usage.requests == 3, "another conversation asks for itself"
