"""Recorded poses are seen as they were, can be planned for, and are never driven."""

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from formup.apps.main import main
from formup.tools.errors import FleetError, InputError
from formup.tools.fleet.described import fleet_named
from formup.tools.fleet.protocol import (
    Fleet,
    FleetClosedError,
    FleetRequest,
    Motion,
    StalePosesError,
)
from PIL import Image

CSV = "time,robot,x,y,heading\n0,a,1,1,\n0.5,b,2,1,0.5\n1.0,a,1.5,1,\n1000,a,3,1,0\n"
JSONL = '{"time": 0.5, "robot": "a", "x": 1, "y": 1}\n{"time": 0, "robot": 2, "x": 2, "y": 1}\n'
FRAME = {"metres_per_pixel": 0.01, "origin": [0, 300]}


def opened(folder: Path, text: str = CSV, name: str = "poses.csv", **more: Any) -> Fleet:
    (folder / name).write_text(text, encoding="utf-8")
    given = {"fleet": "recorded", "file": name, "radius": 0.05, "frame": FRAME, **more}
    (folder / "team.yaml").write_text(yaml.safe_dump(given))
    return fleet_named(str(folder / "team.yaml"))(FleetRequest((400.0, 300.0), 2))


def looked(fleet: Fleet, times: int) -> list[list[tuple[float, float, float | None]]]:
    async def look() -> list[Any]:
        return [await fleet.observe() for _ in range(times)]

    return [[(p.x, p.y, p.heading) for p in poses] for poses in asyncio.run(look())]


def test_each_look_sees_the_next_moment_where_it_is_fast(tmp_path: Path) -> None:
    fleet = opened(tmp_path, pace="fast")
    first, second, third, last = looked(fleet, 4)
    assert first == [(100, 200, None), (200, 200, -0.5)]
    assert second == [(150, 200, None), (200, 200, -0.5)]
    assert third == last == [(300, 200, 0), (200, 200, -0.5)]
    assert (fleet.radius, fleet.real) == (5, True)


def test_in_real_time_what_was_recorded_for_later_is_not_seen(tmp_path: Path) -> None:
    fleet = opened(tmp_path)
    (now,) = looked(fleet, 1)
    assert now[0][0] in (100, 150)
    fleet = opened(tmp_path, JSONL, "poses.jsonl")
    assert looked(fleet, 1) == [[(200, 200, None), (100, 200, None)]]


def test_a_robot_that_was_not_seen_for_long_is_told(tmp_path: Path) -> None:
    fleet = opened(tmp_path, pace="fast")

    async def look() -> None:
        await fleet.observe(max_age=1.0)
        await fleet.observe(max_age=1.0)
        with pytest.raises(StalePosesError) as stale:
            await fleet.observe(max_age=1.0)
        assert stale.value.ids == ("b",)

    asyncio.run(look())


def test_nobody_is_driven(tmp_path: Path) -> None:
    fleet = opened(tmp_path)

    async def drive() -> None:
        with pytest.raises(FleetError, match="were recorded and cannot be driven; plan for them"):
            await anext(fleet.drive(Motion({"a": np.array([[100.0, 200.0], [110.0, 200.0]])})))
        await fleet.stop()
        await fleet.release()
        await fleet.close()
        with pytest.raises(FleetClosedError):
            await fleet.observe()

    asyncio.run(drive())


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("", "poses.csv", "has no poses"),
        ("time,robot,x\n0,a,1\n", "poses.csv", "line 2, is no pose: y: field required"),
        ("time,robot,x,y\n0,a,1,north\n", "poses.csv", "line 2, is no pose: y: input should be a"),
        ("time,robot,x,y\n0,a,1,nan\n", "poses.csv", "line 2, is no pose: y: input should be"),
        ("time,robot,x,y,z\n0,a,1,1,1\n", "poses.csv", "line 2, is no pose: z: extra"),
        ("time,robot,x,y\n0,a,1,1,1\n", "poses.csv", "line 2, is no pose: "),
        ("time,robot,x,y,heading\n0,a,1,1,nan\n", "poses.csv", "line 2, is no pose: heading: "),
        ("time,robot,x,y\n-1,a,1,1\n", "poses.csv", "line 2, is no pose: time: "),
        ("0,a,1,1\n", "poses.jsonl", "line 1, is no pose: "),
        ("[" * 99_999, "poses.jsonl", "line 1, is no pose: "),
    ],
)
def test_a_mistake_in_the_recording_is_told(
    tmp_path: Path, text: str, name: str, words: str
) -> None:
    with pytest.raises(InputError, match=words) as told:
        opened(tmp_path, text, name)
    assert "\n" not in str(told.value)


def test_a_mistake_in_the_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv cannot be read: No such file"):
        opened(tmp_path, file="none.csv")
    with pytest.raises(InputError, match="radius: input should be greater than 0"):
        opened(tmp_path, radius=0)
    with pytest.raises(InputError, match="'recorded' is described by a file"):
        fleet_named("recorded")


def test_a_plan_is_made_from_where_robots_really_stood(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pixels = np.full((300, 400, 3), 60, np.uint8)
    pixels[100:160, 200:260] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "scene.png")
    opened(tmp_path)
    words = ["run", "scene.png", "Surround it with 2 robots", "--box", "195,95,265,165"]
    words += ["--fleet", "team.yaml", "--plan-only", "--json", "--out", "plan"]
    monkeypatch.chdir(tmp_path)
    for arguments, code, status in (
        (words, 0, "planned"),
        (["deploy", "plan/plan.json", "--fleet", "team.yaml", "--json"], 4, "failed"),
    ):
        monkeypatch.setattr(sys, "argv", ["formup", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        report = json.loads(capsys.readouterr().out)
        assert (ended.value.code, report["status"]) == (code, status), report["message"]
    assert "were recorded and cannot be driven" in report["message"]
    for command in ("check", "simulate"):
        monkeypatch.setattr(sys, "argv", ["formup", "fleet", command, "team.yaml"])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 2
        assert "begin it with `fleet: mqtt` or `fleet: ros`" in capsys.readouterr().err
