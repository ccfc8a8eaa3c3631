"""`formup deploy` and the session it lies beside: each knows where the other left the robots."""

import json
from collections.abc import AsyncGenerator
from pathlib import Path

import pytest
import typer
from formup.agent.report import deployed_since, still_true
from formup.agent.session import load_run
from formup.agent.store.folder import FolderLog, read_events
from formup.apps.cli import app
from formup.apps.main import INTERRUPTED
from formup.tools.errors import InputError, StorageError
from formup.tools.fleet.follow import Followed
from formup.tools.fleet.protocol import Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.formation.encounters import Encounter
from formup.tools.store import read_world

COINS = Path(__file__).parents[2] / "evals/photos/images/us_coins.jpg"
CAGE = ("run", COINS, "Cage the largest coin", "-n", "6", "--plan-only", "--json")


def formup(*arguments: object) -> int:
    try:
        return app([*map(str, arguments)], standalone_mode=False) or 0
    except typer.Exit as end:
        return end.exit_code


@pytest.fixture
def planned(tmp_path: Path) -> Path:
    assert formup(*CAGE, "--out", tmp_path / "out") == 0
    return tmp_path / "out"


def test_a_session_goes_on_where_deploy_left_the_robots(
    planned: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert formup("deploy", planned / "plan.json", "--json") == 0
    (moving,) = [e for e in read_events(planned) if e.kind == "moving"]
    left = load_run(planned)
    assert left.report.status == "deployed"
    assert moving.data["plan_id"] == left.report.plan_id
    stand = {pose.id: (pose.x, pose.y) for pose in left.world.robots}
    capsys.readouterr()
    words = "now surround the largest coin with 4 robots"
    assert formup("resume", planned, words, "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert set(report["robots"]) < set(stand)
    now = {pose.id: (pose.x, pose.y) for pose in load_run(planned).world.robots}
    assert now == stand


def test_a_later_turn_that_makes_no_plan_leaves_the_files_of_the_one_that_did(
    planned: Path,
) -> None:
    files = {name: (planned / name).read_bytes() for name in ("plan.json", "plan.png")}
    assert formup("resume", planned, "thanks", "--json") == 0
    assert {name: (planned / name).read_bytes() for name in files} == files
    assert formup("resume", planned, "the same around the other coin", "--json") == 3
    assert (planned / "question.png").exists()
    assert {name: (planned / name).read_bytes() for name in files} == files
    (planned / "plan.png").unlink()
    formup("resume", planned, "thank you", "--json")
    assert (planned / "plan.png").exists()


def test_deploy_waits_for_whoever_writes_the_session(planned: Path) -> None:
    log = FolderLog(planned / "trace.jsonl")
    with pytest.raises(StorageError, match="being written by another process"):
        formup("deploy", planned / "plan.json")
    log.close()
    assert formup("deploy", planned / "plan.json", "--json") == 0


def test_an_interrupted_deploy_keeps_where_the_robots_stand(
    planned: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = read_world(planned / "plan.json").world.robots
    drive, steps = SimulatedFleet.drive, 3

    async def interrupted(
        self: SimulatedFleet, motion: Motion
    ) -> AsyncGenerator[tuple[Pose, ...], None]:
        left = steps
        async for poses in drive(self, motion):
            yield poses
            left -= 1
            if not left:
                raise KeyboardInterrupt

    monkeypatch.setattr(SimulatedFleet, "drive", interrupted)
    assert formup("deploy", planned / "plan.json") == INTERRUPTED
    assert "stopped on the way" in capsys.readouterr().err
    stored, session = read_world(planned / "plan.json"), load_run(planned)
    assert stored.world.robots == session.world.robots != before
    assert all(pose.seen > 0 for pose in stored.world.robots)
    assert stored.plan_id is not None
    assert session.report.status == "stopped"
    assert "broken off on the way: look where they stand" in session.report.message


def stop_on_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a person stop the simulated robots soon after they were sent off."""
    drive = SimulatedFleet.drive

    async def stopped(
        self: SimulatedFleet, motion: Motion
    ) -> AsyncGenerator[tuple[Pose, ...], None]:
        async for poses in drive(self, motion):
            yield poses
            await self.stop()

    monkeypatch.setattr(SimulatedFleet, "drive", stopped)


def test_a_stopped_deploy_is_told_as_it_is_and_how_to_go_on(
    planned: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    with monkeypatch.context() as patch:
        stop_on_the_way(patch)
        assert formup("deploy", planned / "plan.json", "--json") == 4
    report = json.loads(capsys.readouterr().out)
    assert (report["status"], report["motion"]) == ("stopped", None)
    assert ".;" not in report["message"]
    assert load_run(planned).report.message == report["message"]
    assert formup("resume", planned) == 4
    shown = " ".join(capsys.readouterr().out.split())
    assert "stopped on the way" in shown and "Nothing was moved" not in shown
    onward = f"continue formup deploy {planned / 'plan.json'}"
    assert onward.replace(" ", "") in shown.replace(" ", "")  # whose lines are wrapped
    assert formup("deploy", planned / "plan.json", "--json") == 0
    arrived = json.loads(capsys.readouterr().out)["message"]
    assert load_run(planned).report.message == arrived


def test_what_robots_would_have_met_is_no_longer_told_once_they_are_stopped(
    planned: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_on_the_way(monkeypatch)
    assert formup("deploy", planned / "plan.json", "--json") == 4
    world = load_run(planned).world
    met = Encounter(how="over", robots=("1",), thing="c9", label="coin")
    node = world.plan()
    noted = node.plan.verdict.model_copy(update={"notes": ("Kept.", met.sentence)})
    plan = node.plan.model_copy(update={"verdict": noted})
    node = node.model_copy(update={"plan": plan, "encounters": (met,)})
    arrival = world.arrivals[plan.id]
    verdict, motion = still_true(node, arrival)
    assert (verdict.notes, motion) == (("Kept.",), None)
    there = arrival.model_copy(update={"arrived": True, "ended": "arrived"})
    assert still_true(node, there) == (noted, node.motion)
    assert node.motion is not None
    numbers = {"seconds": 1, "moved_px": 0, "speed_px_s": 0, "lag_px": 0, "certified": 1}
    left = Followed(target="t1", separation_px=None, ended="stopped", reason="Held.", **numbers)
    led = there.model_copy(update={"follow": left})
    assert deployed_since(plan, led, None)[0] == "stopped"


def test_a_plan_is_followed_with_for_so_long(
    planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fleet = tmp_path / "slow.yaml"
    fleet.write_text("fleet: simulated\ntargets: {t1: {walk: 3}}\n", encoding="utf-8")
    drive = ("deploy", planned / "plan.json", "--json", "--fleet", fleet)
    capsys.readouterr()
    assert formup(*drive, "--follow", 1, "--follow-speed", 5) == 0
    report = json.loads(capsys.readouterr().out)
    follow = report["arrival"]["follow"]
    assert (follow["ended"], follow["seconds"], follow["certified"]) == ("time", 1.0, 1.0)
    assert "They followed t1 for 1.0 s" in report["message"]
    assert formup(*drive, "--follow", 1, "--follow-speed", 1) == 4
    assert "no more than 1 px/s were allowed" in capsys.readouterr().out
    with pytest.raises(InputError, match="--follow-speed needs --follow SECONDS"):
        formup(*drive, "--follow-speed", 5)


@pytest.mark.parametrize("ending", ["json", "csv"])
def test_trajectories_are_written_and_no_robot_is_moved(planned: Path, ending: str) -> None:
    file, before = planned / f"ways.{ending}", (planned / "plan.json").read_bytes()
    assert formup("deploy", planned / "plan.json", "--trajectories", file) == 0
    assert (planned / "plan.json").read_bytes() == before
    assert not [e for e in read_events(planned) if e.kind == "moving"]
    text = file.read_text()
    places = read_world(planned / "plan.json").world.plan().plan.formation.positions
    if ending == "json":
        poses = {name: r["poses_px"][-1] for name, r in json.loads(text)["robots"].items()}
        ends = [poses[str(k)][1:3] for k in range(1, 7)]
    else:
        last = {row[0]: row[2:4] for row in (line.split(",") for line in text.splitlines()[1:])}
        ends = [[float(v) for v in last[str(k)]] for k in range(1, 7)]
    for end, place in zip(ends, places, strict=True):
        assert end == pytest.approx(place, abs=0.5)


def test_trajectories_of_another_ending_are_refused(planned: Path) -> None:
    with pytest.raises(InputError, match=r"ending in \.json, \.csv"):
        formup("deploy", planned / "plan.json", "--trajectories", planned / "ways.txt")
