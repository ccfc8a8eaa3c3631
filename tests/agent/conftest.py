"""A picture, a formation in it, and robots whose drives are counted."""

from collections.abc import AsyncGenerator
from typing import Any

import numpy as np
import pytest
from formup.agent.messages import Call
from formup.tools.fleet.protocol import Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.perception.image import Picture, picture_from_array


@pytest.fixture(scope="session")
def red_box() -> Picture:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    return picture_from_array(pixels)


@pytest.fixture(scope="session")
def propose() -> Call:
    """Six robots around the red box."""
    arguments: dict[str, Any] = {
        "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
        "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
    }
    return Call(id="p", name="propose_formation", arguments=arguments)


@pytest.fixture
def drives(monkeypatch: pytest.MonkeyPatch) -> list[Motion]:
    """What robots were sent to drive."""
    sent: list[Motion] = []
    drive = SimulatedFleet.drive

    async def counted(
        self: SimulatedFleet, motion: Motion
    ) -> AsyncGenerator[tuple[Pose, ...], None]:
        sent.append(motion)
        async for poses in drive(self, motion):
            yield poses

    monkeypatch.setattr(SimulatedFleet, "drive", counted)
    return sent


@pytest.fixture
def real(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots that count as real."""
    monkeypatch.setattr(SimulatedFleet, "real", True)
