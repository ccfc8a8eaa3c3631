"""A doubtful outline is used once a person says yes to it, and only that one."""

from pathlib import Path

import pytest
from formup.agent.agent import Agent
from formup.agent.session import Run, load_run
from formup.tools.context import Services, Settings
from formup.tools.perception.image import Picture, load_picture
from formup.tools.perception.target_prompt import TargetPrompt

PHOTO = Path(__file__).parents[2] / "evals/photos/images/us_coins.jpg"
COIN = TargetPrompt(box=(175, 30, 314, 160))
STRICT = Settings(robots=8, threshold=0.999)


@pytest.fixture(scope="module")
def coins() -> Picture:
    return load_picture(PHOTO)


def asked(coins: Picture, prompt: TargetPrompt = COIN, trace: Path | None = None) -> Run:
    run = Agent().run(coins, "Surround the coin", pointed=[prompt], settings=STRICT, trace=trace)
    assert run.report.status == "question"
    assert "or say yes if the outline shown is right" in run.report.message
    return run


@pytest.mark.parametrize("answer", ["yes", "Yes, that's it.", "ok", "yes please"])
def test_a_yes_makes_the_outline_shown_the_target(coins: Picture, answer: str) -> None:
    run = asked(coins)
    shown = run.world.doubted
    assert shown is not None and run.view() is not None
    done = Agent().resume(run, answer=answer)
    assert done.report.status == "deployed", done.report.message
    (target,) = done.world.targets
    assert target.outline == shown.outline
    assert done.world.doubted is None


@pytest.mark.parametrize("answer", ["no", "yes but the smaller one", "hm", "the left one"])
def test_anything_else_does_not(coins: Picture, answer: str) -> None:
    done = Agent().resume(asked(coins), answer=answer)
    assert done.report.status not in ("deployed", "planned", "stopped", "failed")
    assert done.world.plans == {}


def test_a_no_ends_the_turn(coins: Picture) -> None:
    done = Agent().resume(asked(coins), answer="no")
    assert done.report.message == "Nothing was placed, as you said no."


@pytest.mark.parametrize(("answer", "targets"), [("yes", ["t1", "t2"]), ("no", ["t1"])])
def test_a_later_turn_asks_so_too(coins: Picture, answer: str, targets: list[str]) -> None:
    done = Agent().resume(asked(coins), answer="yes")
    penny = TargetPrompt(box=(166, 301, 237, 371))
    more = Agent().say(done, "Now around this one", pointed=[penny], settings=STRICT)
    assert more.report.status == "question"
    last = Agent().resume(more, answer=answer)
    assert [t.id for t in last.world.targets] == targets
    assert (last.report.plan_id == done.report.plan_id) == (answer == "no")


def test_a_yes_is_in_the_log(coins: Picture, tmp_path: Path) -> None:
    run = asked(coins, trace=tmp_path / "trace.jsonl")
    done = Agent().resume(run, answer="yes")
    assert done.stored is not None
    again = load_run(done.stored, coins, Services())
    assert again.world.targets == done.world.targets
    assert again.report.plan_id == done.report.plan_id
