"""A file describes a simulated fleet, and every mistake in it is one clear sentence."""

import asyncio
from contextlib import aclosing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from formup.tools.errors import InputError
from formup.tools.fleet.described import described_as, fleet_named, stated_radius
from formup.tools.fleet.protocol import FleetRequest
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.fleet.wire.settings import WireSettings

EXAMPLE = Path(__file__).parents[3] / "examples/hamsters.yaml"
REQUEST = FleetRequest((640.0, 480.0), 4)

ROOT = Path(__file__).parents[3]


def opened(path: Path, request: FleetRequest = REQUEST) -> SimulatedFleet:
    fleet = fleet_named(str(path))(request)
    assert isinstance(fleet, SimulatedFleet)
    return fleet


def written(folder: Path, text: str) -> Path:
    path = folder / "team.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_example_is_the_fleet_it_describes() -> None:
    fleet = opened(EXAMPLE)
    assert (fleet.speed, fleet.radius, fleet.pace.speed) == (120.0, 5.0, None)
    assert len(asyncio.run(fleet.observe())) == 4


def test_things_stand_until_they_are_followed_and_move_as_the_file_says() -> None:
    fleet = opened(EXAMPLE.with_name("moving.yaml"))

    async def followed() -> None:
        (robot, *_), (still,) = await fleet.observe(), await fleet.sightings()
        assert (still.id, still.dx, still.dy, still.turn) == ("t1", 0, 0, 0)
        async with aclosing(fleet.accompany(lambda: {robot.id: (9, 9, 0, 0)})) as steps:
            seen = still
            while seen.seen < 1 - 1e-6:
                poses = await anext(steps)
                (seen,) = await fleet.sightings()
                assert {pose.seen for pose in poses} == {seen.seen}
        assert np.hypot(seen.dx, seen.dy) == pytest.approx(20)
        assert np.degrees(seen.turn) == pytest.approx(-2)

    asyncio.run(followed())


def test_what_a_file_leaves_out_is_as_without_one(tmp_path: Path) -> None:
    usual = fleet_named("simulated")(REQUEST)
    fleet = opened(written(tmp_path, "fleet: simulated\npace: real\n"))
    assert (fleet.speed, fleet.radius, fleet.pace.speed) == (usual.speed, usual.radius, 1.0)
    wide = replace(REQUEST, radius=7.0)
    assert opened(written(tmp_path, "fleet: simulated\nspeed: 50"), wide).radius == 7.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "begin it with a line `fleet: simulated`"),
        ("- fleet: simulated", "begin it with a line `fleet: simulated`"),
        ("drive: point", "does not say `fleet`: one of simulated"),
        ("fleet: navy", "Unknown fleet 'navy'. There are: simulated"),
        ("fleet: simulated\nfleet: simulated", "'fleet' is said more than once"),
        ("fleet: simulated\nnoise: {sensing: 1, sensing: 2}", "'sensing' is said more than once"),
        ("fleet: [simulated", "is not YAML"),
        ("fleet: simulated\nlost: [{robot: 0017}]", "2 has 0017, .*number 15; put it in quotes if"),
        ("fleet: simulated\ntargets: {00: {walk: 3}}", "line 2 has 00, .* else write 0"),
        (
            "fleet: simulated\nlost: [{robot: 12:34}]",
            "12:34, which YAML reads as the number 754",
        ),
        ("fleet: simulated\nlost: [{robot: yes}]", "robot: .* string, got True: put it in quotes"),
        ("fleet: !!python/object:os.system {}", "is not YAML"),
        ("fleet: simulated\npace: slow", "pace is fast or real, got 'slow'"),
        ("fleet: simulated\nslipp: 0.1", "slipp: no such key"),
        ("fleet: simulated\nnoise: {smell: 1}", "noise.smell: no such key"),
        ("fleet: simulated\ndrive: tank", "drive: input should be 'point' or 'differential'"),
        ("fleet: simulated\nspeed: 0", "speed: input should be greater than 0, got 0"),
        ("fleet: simulated\nspeed: .nan", "speed: input should be a finite number"),
        ("fleet: simulated\ndelay: -1\nslip: 2", "delay: .*got -1; slip|slip: .*; delay"),
        ("fleet: simulated\nstuck: [{after: 1}]", "stuck.0.robot: field required"),
        ("fleet: simulated\npushes: [{robot: 1, at: 1, by: 3}]", "pushes.0.by"),
        ("fleet: simulated\ntargets: {t1: {speed: 3}}", "targets.t1: .*two points or more and a"),
        ("fleet: simulated\ntargets: {t1: {path: [[0, 0]], speed: 3}}", "two points or more and a"),
        ("fleet: simulated\ntargets: {t1: {path: [[0, 0], [9, 9]]}}", "two points or more and a"),
        ("fleet: simulated\ntargets: {t1: {runs: 3}}", "targets.t1.runs: no such key"),
    ],
)
def test_a_mistake_is_found_before_a_fleet_is_opened(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        fleet_named(str(written(tmp_path, text)))
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_and_faults_of_nobody_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.yaml cannot be read: No such file"):
        fleet_named(str(tmp_path / "none.yaml"))
    with pytest.raises(InputError, match="mqtt is no file; give the YAML file of a fleet"):
        described_as(WireSettings, Path("mqtt"))
    nobody = written(tmp_path, "fleet: simulated\nlost: [{robot: 9}, {robot: 2}]")
    with pytest.raises(InputError, match="faults of robot 9; the fleet has 4 robots, 1 to 4"):
        opened(nobody)


def test_robots_are_as_large_as_the_file_says(tmp_path: Path) -> None:
    text = (ROOT / "examples/warehouse.yaml").read_text("utf-8")
    settings = described_as(WireSettings, ROOT / "examples/warehouse.yaml")
    metres = settings.frame.metres_per_pixel
    assert stated_radius(str(written(tmp_path, text))) == pytest.approx(settings.radius / metres)
    assert stated_radius(str(written(tmp_path, "fleet: simulated\nradius: 5"))) == 5.0
    assert stated_radius(str(written(tmp_path, "fleet: simulated"))) is None
    assert stated_radius("simulated") is None
