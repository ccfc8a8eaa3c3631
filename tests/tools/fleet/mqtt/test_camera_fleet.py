"""Robots at a real broker that a camera sees: a drawn room, by where the stand-ins truly are."""

import asyncio
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from deploying import ROOT
from drawn import MORE, SEEN, Drawn, deployed
from formup.tools.errors import InputError
from formup.tools.fleet.described import described_as
from formup.tools.fleet.mqtt.checkup import checked
from formup.tools.fleet.mqtt.fleet import open_fleet
from formup.tools.fleet.mqtt.settings import MqttSettings
from formup.tools.fleet.protocol import FleetRequest, Pose, points_of
from formup.tools.perception.cameras.calibration import through

Labs = Callable[..., Any]


@pytest.fixture
def there(lab: Labs, drawn: Drawn) -> Any:
    made = lab(**MORE).simulate()
    drawn.lab = made
    return made


def test_robots_arrive_by_what_the_camera_sees(there: Any) -> None:
    arrival, planned = deployed(there)
    assert arrival.arrived, arrival
    off = there.robots.points[:, None] - planned.formation.points[None]
    millimetres = 1000 * SEEN.metres_per_pixel * np.linalg.norm(off, axis=2).min(axis=1)
    assert millimetres.max() < 10
    assert 0 < max(arrival.residual_px) * SEEN.metres_per_pixel < 0.003  # as seen, not as said


def test_poses_are_the_camera_s_and_not_what_robots_say(there: Any) -> None:
    def elsewhere(message: dict[str, Any], n: int) -> dict[str, Any]:
        return {**message, "x": 3.0, "y": 2.5}

    there.robots.faults.update(b=elsewhere)

    async def seen() -> tuple[Pose, ...]:
        fleet = there.fleet()
        try:
            return await fleet.observe()
        finally:
            await fleet.close()

    poses = asyncio.run(seen())
    assert np.abs(points_of(poses) - there.robots.points).max() * SEEN.metres_per_pixel < 0.005
    assert [pose.heading for pose in poses] == pytest.approx([-0.3] * 3, abs=math.radians(1))


def hangs(drawn: Drawn) -> None:
    drawn.hangs = True


def hands_out_old_frames(drawn: Drawn) -> None:
    drawn.old = True


def has_b_covered(drawn: Drawn) -> None:
    drawn.covered.add("b")


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (hangs, "Camera 0 has shown nothing for"),
        (hands_out_old_frames, "Camera 0 has shown the very same picture"),
        (has_b_covered, "Robot b not seen for"),
    ],
)
def test_what_is_not_seen_is_not_driven(
    there: Any, drawn: Drawn, fault: Callable[[Drawn], None], words: str
) -> None:
    arrival, _ = deployed(there, lambda: fault(drawn))
    assert not arrival.arrived
    assert words in (arrival.reason or "")
    assert "b" in arrival.failed
    before = there.robots.points.copy()
    time.sleep(0.3)
    assert np.abs(there.robots.points - before).max() < 0.5


def test_a_camera_that_shows_nothing_is_named_by_the_check(lab: Labs, drawn: Drawn) -> None:
    drawn.hangs = True
    told, fit = checked(lab(**MORE).settings, 0.8)
    assert not fit
    assert "Camera 0 has shown nothing for" in told[0]


def test_the_check_sees_robots_by_their_tags(there: Any) -> None:
    told, fit = checked(there.settings, 1.5)
    assert fit, told
    assert "3 of 3 robots can be driven." in told


def test_tags_of_another_size_are_not_believed(lab: Labs, drawn: Drawn) -> None:
    drawn.lab = lab(**{**MORE, "camera": {**MORE["camera"], "tag_size": 0.2}}).simulate()
    told, fit = checked(drawn.lab.settings, 1.0)
    assert not fit
    assert "The tag of robot a seems 0.120 m wide, and not 0.2 m." in told[0]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"tags": {"a": 4, "b": 7}}, "camera.tags takes every robot"),
        ({"tags": {"a": 4, "b": 7, "c": 7}}, "a tag of its own"),
        ({"dictionary": "DICT_3X3"}, "no such dictionary"),
        ({"calibration": "none.yaml"}, "none.yaml cannot be read"),
        ({"tag_height": 3.0}, "below the tags"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    lab: Labs, drawn: Drawn, more: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        lab(**{**MORE, "camera": {**MORE["camera"], **more}})


def test_the_frame_is_the_calibration_s(lab: Labs, drawn: Drawn) -> None:
    with pytest.raises(InputError, match="frame is that of the camera's calibration"):
        lab(**MORE, frame={"metres_per_pixel": 0.01})
    frame = lab(**MORE).settings.frame
    assert frame.to_picture(1.0, 2.0) == pytest.approx(
        tuple(through(SEEN.to_top, np.array([(1.0, 2.0)]))[0])
    )


def test_a_picture_that_the_camera_has_not_seen_from_above_is_refused(
    lab: Labs, drawn: Drawn
) -> None:
    made = lab(**MORE)
    with pytest.raises(InputError, match="720 x 520"):
        open_fleet(FleetRequest((640, 480), 3, config=made.path))


def test_the_example_can_be_read_beside_a_calibration(drawn: Drawn, tmp_path: Path) -> None:
    example = (ROOT / "examples/tagged.yaml").read_text("utf-8")
    (tmp_path / "tagged.yaml").write_text(example)
    settings = described_as(MqttSettings, tmp_path / "tagged.yaml")
    assert settings.camera is not None
    shown = (ROOT / "docs/cameras.md").read_text("utf-8").partition("```yaml\n")[2]
    page = yaml.safe_load(shown.partition("```")[0])
    assert page["camera"] == yaml.safe_load(example)["camera"]
