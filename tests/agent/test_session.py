"""A session written down: read back, gone on with in another process, replayed, or refused."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.fold import fold, read_messages
from formup.agent.limits import Limits
from formup.agent.messages import Call, Reply, Result, Usage, turn_of
from formup.agent.model import Request
from formup.agent.outcomes import Answered, Paused, Stopped
from formup.agent.policy import Policy
from formup.agent.providers.registry import model_named
from formup.agent.session import Run, load_run
from formup.agent.store.folder import FolderArtefacts, read_events
from formup.agent.wrappers.doubles import FunctionModel, ScriptedModel
from formup.agent.wrappers.replay import ReplayModel
from formup.apps.trace import show_trace
from formup.tools.context import Settings
from formup.tools.errors import InputError, StorageError
from formup.tools.perception.image import Picture, load_picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

COINS = Path(__file__).parents[2] / "evals/photos/images/us_coins.jpg"
BOX = TargetPrompt(box=(175, 30, 314, 160))
PLAN: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
    "targets": [{"id": "t1", "box": [175, 30, 314, 160]}],
}


@pytest.fixture(scope="module")
def coins() -> Picture:
    return load_picture(COINS)


def plan_id(request: Request) -> str:
    results = [m for m in request.messages if isinstance(m, Result)]
    return next(str(json.loads(m.text)["plan_id"]) for m in results if "plan_id" in m.text)


def deciding(request: Request) -> Reply:
    """Looks, proposes, deploys, tells: a model whose replies depend on what it is told."""
    replies = [m for m in turn_of(request.messages) if isinstance(m, Reply)]
    usage = Usage(input_tokens=100, output_tokens=10, cost_usd=0.001)
    if len(replies) == 3:
        return Reply(text="Six robots stand there.", usage=usage)
    calls: list[Callable[[], Call]] = [
        lambda: Call(id="a", name="look", arguments={}),
        lambda: Call(id="b", name="propose_formation", arguments=PLAN),
        lambda: Call(id="c", name="deploy", arguments={"plan_id": plan_id(request)}),
    ]
    return Reply(calls=(calls[len(replies)](),), usage=usage)


def run(trace: Path, picture: Picture, model: Any = None, **more: Any) -> Run:
    agent = Agent(model or FunctionModel(deciding), **more)
    return agent.run(picture, "Surround it", settings=Settings(robots=6), trace=trace)


def alike(one: Run, other: Run) -> bool:
    """The same reports and messages, times aside."""
    usages = [r.report.usage.model_copy(update={"seconds": 0}) for r in (one, other)]
    reports = [
        r.report.model_copy(update={"usage": u}) for r, u in zip((one, other), usages, strict=True)
    ]
    return reports[0] == reports[1] and one.outcome == other.outcome


def cut(trace: Path, lines: int, into: Path, rest: bytes = b"") -> Path:
    """What a process that was killed after so many lines has left."""
    into.mkdir()
    whole = trace.read_bytes().splitlines(keepends=True)
    (into / "trace.jsonl").write_bytes(b"".join(whole[:lines]) + rest)
    (into / "pictures").symlink_to(trace.parent / "pictures")
    return into / "trace.jsonl"


def test_a_log_holds_the_run(coins: Picture, tmp_path: Path) -> None:
    done = run(tmp_path / "trace.jsonl", coins)
    events = read_events(tmp_path)
    artefacts = FolderArtefacts(tmp_path / "pictures")
    lines = [event.data for event in events if event.kind == "message"]
    assert read_messages(lines, artefacts) == done.outcome.messages
    assert [event.kind for event in events if event.kind not in ("message", "world")] == [
        "session",
        "turn",
        "moving",
        "end",
    ]
    assert events[1].data["words"] == "Surround it"
    end = events[-1].data
    assert (end["outcome"], end["status"]) == ("answered", "deployed")
    assert end["usage"]["input_tokens"] == 400
    state = fold(events, artefacts)
    assert (state.world, state.messages) == (done.world, done.outcome.messages)
    (look,) = [line for line in lines if line["images"]]
    assert artefacts.get(look["images"][0]["sha256"]).startswith(b"\xff\xd8")
    again = load_run(tmp_path / "trace.jsonl")
    assert isinstance(again.outcome, Answered)
    assert again.world == done.world
    assert again.report.status == "deployed"
    assert again.report.positions == done.report.positions


def test_before_its_first_message_there_is_nothing_to_go_on_with(
    coins: Picture, tmp_path: Path
) -> None:
    run(tmp_path / "trace.jsonl", coins)
    kinds = [event.kind for event in read_events(tmp_path)]
    for count in range(1, kinds.index("message") + 1):
        with pytest.raises(InputError, match="before anything began"):
            load_run(cut(tmp_path / "trace.jsonl", count, tmp_path / f"{count}"))


def test_replayed_bit_for_bit(coins: Picture, tmp_path: Path) -> None:
    recorded = run(tmp_path / "trace.jsonl", coins)
    replay = model_named(f"replay:{tmp_path / 'trace.jsonl'}")
    assert replay.name == "function"
    again = run(tmp_path / "again.jsonl", coins, replay)
    assert alike(recorded, again)
    logs = [read_events(tmp_path / name) for name in ("trace.jsonl", "again.jsonl")]
    bare = [[(e.number, e.kind, {**e.data, "usage": 0}) for e in log] for log in logs]
    assert bare[0] == bare[1]


def test_a_replay_of_something_else_is_refused(coins: Picture, tmp_path: Path) -> None:
    run(tmp_path / "trace.jsonl", coins)
    agent = Agent(f"replay:{tmp_path / 'trace.jsonl'}")
    other = agent.run(coins, "Cage it", settings=Settings(robots=6))
    assert isinstance(other.outcome, Stopped)
    assert other.report.status == "failed"
    assert "parts from this run at message 1" in other.report.message
    assert "Surround it" in other.report.message
    assert "Cage it" in other.report.message


def test_a_recording_that_ends_too_early_says_so(coins: Picture, tmp_path: Path) -> None:
    run(tmp_path / "trace.jsonl", coins)
    path = cut(tmp_path / "trace.jsonl", 8, tmp_path / "short")
    again = run(tmp_path / "again.jsonl", coins, model_named(f"replay:{path}"))
    assert again.report.status == "failed"
    assert "ends after message" in again.report.message


def test_a_question_is_answered_in_another_process(coins: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    asked = Agent().run(coins, "Ring the coin", pointed=[BOX], trace=path)
    assert asked.report.status == "question"
    left = load_run(path)
    assert isinstance(left.outcome, Paused)
    assert left.report.model_dump(exclude={"usage"}) == asked.report.model_dump(exclude={"usage"})
    with pytest.raises(InputError, match="waits for an answer"):
        Agent().resume(left)
    done = Agent().resume(left, answer="9")
    assert done.report.status == "deployed"
    assert len(done.report.positions or ()) == 9


def test_leave_to_move_is_given_in_another_process(coins: Picture, tmp_path: Path) -> None:
    policy = Policy((("deploy", "ask"),))
    paused = run(tmp_path / "trace.jsonl", coins, policy=policy)
    assert paused.report.status == "needs_approval"
    left = load_run(tmp_path)
    assert left.report.status == "needs_approval"
    assert left.outcome == paused.outcome
    agent = Agent(FunctionModel(deciding), policy=policy)
    done = agent.resume(left, approve=True)
    assert done.report.status == "deployed"
    assert done.report.plan_id == paused.report.plan_id
    (approval,) = [e.data for e in read_events(tmp_path) if e.kind == "approval"]
    assert approval == {"call": "c", "plan_id": paused.report.plan_id}


def test_a_run_that_met_a_limit_goes_on_with_another(coins: Picture, tmp_path: Path) -> None:
    stopped = run(tmp_path / "trace.jsonl", coins, limits=Limits(requests=2))
    assert stopped.report.status == "stopped"
    left = load_run(tmp_path)
    assert isinstance(left.outcome, Stopped)
    assert left.outcome == stopped.outcome
    done = Agent(FunctionModel(deciding)).resume(left)
    assert done.report.status == "deployed"
    assert done.report.usage.seconds > stopped.report.usage.seconds


def test_settings_come_back_too(coins: Picture, tmp_path: Path) -> None:
    starts = ((5.0, 5.0), (5.0, 40.0), (5.0, 80.0))
    settings = Settings(robots=3, starts=starts, clearance=9.5, may_deploy=False)
    script = ScriptedModel([Reply(text="x")])
    Agent(script).run(coins, "Go", settings=settings, trace=tmp_path / "t.jsonl")
    assert load_run(tmp_path / "t.jsonl").context.settings == settings


def test_the_picture_is_beside_the_log_and_is_given_again_where_it_is_not(tmp_path: Path) -> None:
    pixels = np.full((60, 80, 3), 60, np.uint8)
    script = ScriptedModel([Reply(text="x")])
    Agent(script).run(picture_from_array(pixels), "Go", trace=tmp_path / "t.jsonl")
    kept = load_run(tmp_path / "t.jsonl").context.picture
    assert (kept.pixels == pixels).all()
    shutil.rmtree(tmp_path / "pictures")
    with pytest.raises(
        InputError, match=r"neither beside the log nor where it lay.*give it as the image"
    ):
        load_run(tmp_path / "t.jsonl")
    assert load_run(tmp_path / "t.jsonl", picture_from_array(pixels)).report.status == "answered"
    other = picture_from_array(np.zeros((60, 80, 3), np.uint8))
    with pytest.raises(InputError, match="array is not the picture"):
        load_run(tmp_path / "t.jsonl", other)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        "null\n",
        "no json\n",
        '{"n":1,"type":"session","format":"formup-session-1","seconds":0}\n',
        '{"n":1,"type":"session","format":"other","seconds":0}\n',
        '{"n":1,"type":"message","seconds":0}\n',
    ],
)
def test_what_is_no_log_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "t.jsonl"
    path.write_text(text)
    with pytest.raises(InputError, match=r"t\.jsonl"):
        load_run(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_run(tmp_path / "nothing.jsonl")


def alter(path: Path, kind: str, **changes: Any) -> None:
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    for line in lines:
        if line["type"] == kind:
            line.update(changes)
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))


ALTERED: list[tuple[str, dict[str, Any]]] = [
    ("session", {"format": "formup-trace-1"}),
    ("session", {"prompt": {"id": 3}}),
    ("session", {"prompts": 3}),
    ("session", {"policy": [["*", "allow"], ["deploy", "whatever"]]}),
    ("session", {"policy": "deploy=allow"}),
    ("session", {"policy": [["deploy"]]}),
    ("session", {"limits": {"requests": "20"}}),
    ("session", {"limits": {"king": 1}}),
    ("session", {"limits": {"requests": -1}}),
    ("session", {"model": None}),
    ("session", {"planner": 3}),
    ("session", {"king": 1}),
    ("session", {"picture": {"facts": 3}}),
    ("turn", {"settings": {"robots": "x"}}),
    ("turn", {"settings": {"king": 1}}),
    ("turn", {"words": ""}),
    ("message", {"role": "king"}),
    ("message", {"text": 7}),
    ("message", {"images": [{"sha256": "0", "bytes": 1}]}),
    ("world", {"changes": {"king": 1}}),
    ("world", {"changes": {"plans": 1}}),
    ("world", {"changes": {"plans": {"ids": ["p"], "items": {}}}}),
    ("world", {"changes": {"arrivals": {"ids": ["p"], "items": {"p": 1}}}}),
    ("end", {"outcome": "paused"}),
    ("end", {"outcome": "answered"}),
]


@pytest.mark.parametrize(("kind", "changes"), ALTERED)
def test_an_altered_log_is_one_sentence(
    kind: str, changes: dict[str, Any], coins: Picture, tmp_path: Path
) -> None:
    path = tmp_path / "trace.jsonl"
    run(path, coins, limits=Limits(requests=2))
    alter(path, kind, **changes)
    for read in (load_run, show_trace) if kind == "session" else (load_run,):
        with pytest.raises(InputError) as caught:
            read(path)
        assert str(caught.value).startswith(str(tmp_path))
        assert str(caught.value).count("\n") == 0


def test_a_log_without_its_beginning_is_refused(coins: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    run(path, coins, limits=Limits(requests=2))
    lines = [json.loads(line) for line in path.read_text().splitlines()][1:]
    path.write_text("".join(json.dumps(line | {"n": line["n"] - 1}) + "\n" for line in lines))
    for read in (load_run, ReplayModel, show_trace):
        with pytest.raises(StorageError, match="does not begin with a line that formup wrote"):
            read(path)


def test_what_a_trace_shows_may_be_damaged(coins: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    run(path, coins, limits=Limits(requests=2))
    alter(path, "message", calls=[3], role="assistant")
    with pytest.raises(InputError, match="is damaged"):
        show_trace(path)


def test_a_picture_of_a_message_that_was_changed_is_refused(coins: Picture, tmp_path: Path) -> None:
    run(tmp_path / "trace.jsonl", coins)
    (look,) = [e.data["images"] for e in read_events(tmp_path) if e.data.get("images")]
    (tmp_path / f"pictures/{look[0]['sha256'][:16]}.jpg").write_bytes(b"\xff\xd8 other")
    with pytest.raises(InputError, match="is not the file that its log means"):
        load_run(tmp_path)


def test_a_log_that_cannot_be_written_is_refused_first(coins: Picture, tmp_path: Path) -> None:
    script = ScriptedModel([])
    with pytest.raises(InputError, match=r"cannot be (written|made)"):
        Agent(script).run(coins, "Go", trace=tmp_path / "no folder" / "t.jsonl")
    assert not script.requests


def test_an_altered_plan_is_not_gone_on_with(coins: Picture, tmp_path: Path) -> None:
    path = tmp_path / "trace.jsonl"
    run(path, coins, policy=Policy((("deploy", "ask"),)))
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    plans = [p for line in lines for p in line.get("changes", {}).get("plans", {}).get("items", {})]
    assert len(plans) == 1
    for line in lines:
        for node in line.get("changes", {}).get("plans", {}).get("items", {}).values():
            node["plan"]["formation"]["positions"][0][0] += 1
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.raises(InputError, match="altered"):
        load_run(path)


def many_proposals(request: Request) -> Reply:
    """Ten formations of thirty robots, each another distance away, then the end."""
    count = sum(isinstance(m, Reply) for m in request.messages)
    if count == 10:
        return Reply(text="Ten plans.")
    group = {"relation": "around", "targets": ["t1"], "robots": 30, "clearance": [8 + count, 40]}
    arguments = {"contract": {"groups": [group]}} | ({} if count else {"targets": PLAN["targets"]})
    return Reply(calls=(Call(id=f"p{count}", name="propose_formation", arguments=arguments),))


def test_a_log_of_many_plans_is_small(coins: Picture, tmp_path: Path) -> None:
    model = FunctionModel(many_proposals)
    done = Agent(model).run(coins, "Surround it", trace=tmp_path / "trace.jsonl")
    assert len(done.world.plans) == 10
    assert all(len(n.plan.formation.positions) == 30 for n in done.world.plans.values())
    assert (tmp_path / "trace.jsonl").stat().st_size <= 40_000
    assert load_run(tmp_path).world == done.world
