"""Turns of a session: what a person says next, and a process that is killed anywhere in them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.limits import Limits
from formup.agent.messages import Call, Message, Reply, Result, User, turn_of
from formup.agent.model import Request
from formup.agent.outcomes import Answered, Cancelled, Paused, Stopped
from formup.agent.session import Run, load_run
from formup.agent.store.folder import read_events
from formup.agent.wrappers.doubles import FunctionModel, ScriptedModel
from formup.tools.builtin.tracks import read_track
from formup.tools.context import Settings
from formup.tools.errors import InputError
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

RED, BLUE = (55, 35, 125, 95), (235, 115, 305, 175)
FIRST, SECOND = "Surround the red thing", "And now the blue one"


@pytest.fixture(scope="module")
def picture() -> Picture:
    pixels = np.full((220, 360, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    pixels[120:170, 240:300] = (40, 60, 210)
    return picture_from_array(pixels)


def proposal(target: str, box: Sequence[int], robots: int = 6) -> dict[str, Any]:
    group = {"relation": "around", "targets": [target], "robots": robots}
    return {"contract": {"groups": [group]}, "targets": [{"id": target, "box": list(box)}]}


def call(id: str, name: str, **arguments: Any) -> Call:
    return Call(id=id, name=name, arguments=arguments)


def deciding(request: Request) -> Reply:
    """Proposes and deploys around the red thing, in the next turn around the blue one."""
    turn = turn_of(request.messages)
    replies = sum(isinstance(m, Reply) for m in turn)
    number = sum(isinstance(m, User) for m in request.messages)
    arguments = proposal("t1", RED) if number == 1 else proposal("t2", BLUE)
    if replies == 0:
        return Reply(calls=(call(f"p{number}", "propose_formation", **arguments),))
    if replies == 1:
        plan_id = json.loads(turn[-1].text)["plan_id"]
        return Reply(calls=(call(f"d{number}", "deploy", plan_id=plan_id),))
    return Reply(text=f"Turn {number} is done.")


def test_a_plan_that_is_only_shown_takes_one_reply(picture: Picture) -> None:
    arguments = proposal("t1", RED) | {"tell": "Six would stand around it."}
    model = ScriptedModel([Reply(calls=(call("p", "propose_formation", **arguments),))])
    settings = Settings(robots=6, may_deploy=False)
    run = Agent(model).run(picture, FIRST, settings=settings)
    assert (run.report.status, run.report.message) == ("planned", "Six would stand around it.")
    assert run.report.usage.requests == 1
    again = Agent(FunctionModel(deciding)).say(run, SECOND, settings=Settings(robots=6))
    assert again.report.status == "deployed"


def agent(**more: Any) -> Agent:
    return Agent(FunctionModel(deciding), **more)


def two_turns(picture: Picture, trace: Path | None) -> tuple[Run, Run]:
    settings = Settings(robots=6)
    first = agent().run(picture, FIRST, settings=settings, trace=trace)
    return first, agent().say(first, SECOND)


def texts(messages: Sequence[Message]) -> list[str]:
    return [m.text for m in messages if isinstance(m, User)]


def test_the_next_turn_goes_on_from_the_first(picture: Picture, tmp_path: Path) -> None:
    first, second = two_turns(picture, tmp_path / "trace.jsonl")
    assert (first.report.status, second.report.status) == ("deployed", "deployed")
    assert second.outcome.messages[: len(first.outcome.messages)] == first.outcome.messages
    assert len(texts(second.outcome.messages)) == 2
    assert SECOND in texts(second.outcome.messages)[1]
    assert [t.id for t in second.world.targets] == ["t1", "t2"]
    assert list(second.world.plans)[:1] == list(first.world.plans)
    assert len(second.world.plans) == 2
    assert list(second.world.arrivals) == list(second.world.plans)
    assert second.world.current == second.report.plan_id != first.report.plan_id


def test_its_report_is_of_itself(picture: Picture) -> None:
    first, second = two_turns(picture, None)
    assert (second.report.instruction, second.report.message) == (SECOND, "Turn 2 is done.")
    assert second.report.usage.requests == first.report.usage.requests == 3
    assert second.report.contract is not None
    assert second.report.contract.groups[0].targets == ("t2",)
    nothing = Agent(ScriptedModel([Reply(text="Nothing to do.")])).say(second, "Thanks")
    assert (nothing.report.message, nothing.report.arrival) == ("Nothing to do.", None)
    assert nothing.report.usage.requests == 1


@pytest.mark.parametrize("another_process", [False, True])
def test_robots_start_where_the_turn_before_ended(
    another_process: bool, picture: Picture, tmp_path: Path
) -> None:
    path = tmp_path / "trace.jsonl"
    first = agent().run(picture, FIRST, settings=Settings(robots=6), trace=path)
    assert first.report.arrival is not None
    observed = dict(zip(first.report.arrival.robots, first.report.arrival.observed, strict=True))
    second = agent().say(load_run(path) if another_process else first, SECOND)
    assert second.report.arrival is not None
    assert second.report.arrival.track is not None
    track = read_track(second.context.services.artefacts.get(second.report.arrival.track))
    assert sorted(track.ids) == sorted(observed)
    for robot, start in zip(track.ids, track.points[0], strict=True):
        assert start == pytest.approx(observed[robot], abs=1)
    ended = {pose.id: (pose.x, pose.y) for pose in second.world.robots}
    goals = dict(zip(second.report.robots or (), second.report.positions or (), strict=True))
    for robot, place in goals.items():
        assert ended[robot] == pytest.approx(place, abs=1)


def test_it_can_be_said_in_another_process(picture: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    first = agent().run(picture, FIRST, settings=Settings(robots=6), trace=path)
    second = agent().say(load_run(path), SECOND)
    assert second.report.status == "deployed"
    assert next(iter(second.world.plans)) == first.report.plan_id
    assert len(second.world.targets) == 2
    again = load_run(path)
    assert again.world == second.world
    assert again.outcome == second.outcome
    assert again.report.instruction == SECOND
    assert again.report.positions == second.report.positions
    kinds = [event.kind for event in read_events(path)]
    assert (kinds.count("session"), kinds.count("turn"), kinds.count("end")) == (1, 2, 2)


def test_the_rules_turn_to_what_is_pointed_at_next(picture: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    one, other = TargetPrompt(box=RED), TargetPrompt(id="t2", box=BLUE)
    first = Agent().run(picture, "Surround it with 5 robots", pointed=[one], trace=path)
    second = Agent().say(load_run(path), "Surround this one with 7 robots", pointed=[other])
    assert (first.report.status, second.report.status) == ("deployed", "deployed")
    assert [len(r.report.positions or ()) for r in (first, second)] == [5, 7]
    assert [t.id for t in second.world.targets] == ["t1", "t2"]
    assert second.report.contract is not None
    assert second.report.contract.groups[0].targets == ("t2",)
    assert list(second.world.arrivals) == [first.report.plan_id, second.report.plan_id]
    third = Agent().say(second, "Surround the red thing with 4 robots")
    assert third.report.status == "deployed"
    assert third.world.pointed == ()


def test_the_rules_leave_what_they_found_before_where_it_is(picture: Picture) -> None:
    first = Agent().run(picture, "Surround the red thing with 5 robots")
    second = Agent().say(first, "Now surround the blue thing with 7 robots")
    third = Agent().say(second, "Surround the red thing with 4 robots")
    for run in (first, second, third):
        assert run.report.status == "deployed", run.report.message
        assert run.report.contract is not None
    labels = {t.id: t.label for t in third.world.targets}
    assert labels == {"t1": "red thing", "t2": "blue thing"}
    about = [n.plan.formation.contract.target_ids for n in third.world.plans.values()]
    assert about == [("t1",), ("t2",), ("t1",)]
    assert next(iter(third.world.plans)) == first.report.plan_id


def test_limits_are_of_each_turn(picture: Picture) -> None:
    limits = Limits(requests=3, tool_calls=3)
    first = agent(limits=limits).run(picture, FIRST, settings=Settings(robots=6))
    second = agent(limits=limits).say(first, SECOND)
    assert (first.report.status, second.report.status) == ("deployed", "deployed")
    assert isinstance(second.outcome, Answered)
    fewer = agent(limits=Limits(requests=2)).say(first, SECOND)
    assert isinstance(fewer.outcome, Stopped)
    assert fewer.report.status == "deployed"  # it met the limit when they had arrived
    assert "The limit of 2 requests was reached" in fewer.report.message


def test_repetition_is_of_each_turn(picture: Picture) -> None:
    def looking(request: Request) -> Reply:
        replies = sum(isinstance(m, Reply) for m in turn_of(request.messages))
        if replies == 2:
            return Reply(text="I looked twice.")
        return Reply(calls=(call(f"c{len(request.messages)}", "locate_object"),))

    run = Agent(FunctionModel(looking)).run(picture, "Look")
    for _ in range(3):
        run = Agent(FunctionModel(looking)).say(run, "Look again")
        assert isinstance(run.outcome, Answered), run.report.message


def test_a_question_is_dropped_by_what_is_said_instead(picture: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    asks = Reply(calls=(call("q", "ask_user", question="Which?"), call("l", "look")))
    asked = Agent(ScriptedModel([asks])).run(picture, "Surround it", trace=path)
    assert isinstance(asked.outcome, Paused)
    second = Agent(ScriptedModel([Reply(text="As you like.")])).say(load_run(path), "Never mind")
    assert isinstance(second.outcome, Answered)
    results = [m for m in second.outcome.messages if isinstance(m, Result)]
    assert [(m.call_id, m.error) for m in results] == [("q", "refused"), ("l", "refused")]
    assert results[0].text == "No result: the person interrupted it, or went on."
    assert load_run(path).outcome == second.outcome


def test_what_cannot_be_said_changes_nothing(picture: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    first = agent().run(picture, FIRST, settings=Settings(robots=6), trace=path)
    before = path.read_bytes()
    outside = TargetPrompt(box=(900, 10, 950, 60))
    for words, pointed in (("", ()), ("x" * 4_001, ()), ("Go", (outside,))):
        with pytest.raises(InputError):
            agent().say(first, words, pointed=pointed)
    assert path.read_bytes() == before


def cut(trace: Path, into: Path, data: bytes) -> Path:
    """What a process that was killed has left."""
    into.mkdir()
    (into / "trace.jsonl").write_bytes(data)
    (into / "pictures").symlink_to(trace.parent / "pictures")
    return into / "trace.jsonl"


def gone_on(left: Run) -> Run:
    """A run as somebody goes on with it who wants both turns."""
    done = left if isinstance(left.outcome, Answered) else agent().resume(left)
    return agent().say(done, SECOND) if done.report.instruction == FIRST else done


def test_killed_anywhere_it_goes_on_to_the_same_end(picture: Picture, tmp_path: Path) -> None:
    """After every event, and in the middle of every line."""
    path = tmp_path / "trace.jsonl"
    whole = two_turns(picture, path)[1]
    lines = path.read_bytes().splitlines(keepends=True)
    kinds = [event.kind for event in read_events(path)]
    begins = kinds.index("message") + 1
    assert len(lines) > 20
    seen: set[type] = set()
    for count in range(len(lines)):
        for rest in (b"", lines[count][: len(lines[count]) // 2]):
            into = tmp_path / f"{count}-{len(rest)}"
            trace = cut(path, into, b"".join(lines[:count]) + rest)
            if count < begins:
                with pytest.raises(InputError) as caught:
                    load_run(trace)
                assert "\n" not in str(caught.value)
                continue
            left = load_run(trace)
            seen.add(type(left.outcome))
            assert isinstance(left.outcome, Answered | Cancelled)
            done = gone_on(left)
            assert done.report.status == "deployed", count
            assert done.report.instruction == SECOND
            assert done.report.positions == whole.report.positions
            assert [t.id for t in done.world.targets] == ["t1", "t2"]
            assert load_run(trace).outcome == done.outcome
            assert load_run(trace).world == done.world
    assert seen == {Answered, Cancelled}


def test_a_turn_of_which_nothing_was_said_has_not_begun(picture: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    box = TargetPrompt(id="t2", box=BLUE)
    first = agent().run(picture, FIRST, settings=Settings(robots=6), trace=path)
    agent().say(first, SECOND, pointed=[box])
    lines = path.read_bytes().splitlines(keepends=True)
    kinds = [(event.kind, event.data.get("role")) for event in read_events(path)]
    spoken = kinds.index(("message", "user"), kinds.index(("end", None)))
    trace = cut(path, tmp_path / "killed", b"".join(lines[:spoken]))
    left = load_run(trace)
    assert isinstance(left.outcome, Answered)
    assert (left.report.instruction, left.world.pointed) == (FIRST, ())
    done = agent().say(left, "Something else")
    assert load_run(trace).world == done.world
    assert load_run(trace).world.pointed == ()


def test_a_turn_that_a_tool_ended_is_over_though_its_end_is_lost(
    picture: Picture, tmp_path: Path
) -> None:
    path = tmp_path / "trace.jsonl"
    both = Reply(
        calls=(
            call("p", "propose_formation", **proposal("t1", RED)),
            call("d", "deploy", tell="They stand there."),
        )
    )
    whole = Agent(ScriptedModel([both])).run(picture, FIRST, trace=path)
    lines = path.read_bytes().splitlines(keepends=True)
    trace = cut(path, tmp_path / "killed", b"".join(lines[:-1]))
    left = load_run(trace)
    assert isinstance(left.outcome, Answered)
    assert (left.report.status, left.report.message) == ("deployed", whole.report.message)
