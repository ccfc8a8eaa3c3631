"""A real broker and a drawn camera, for fleets that are reached or seen through them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import pytest
from broker import Broker, brokers
from drawn import SEEN, Drawn

__all__ = ["brokers"]


@pytest.fixture(scope="session")
def shared(brokers: Callable[..., Broker]) -> Broker:
    """One broker for all tests that leave it alone; each has topics of its own."""
    return brokers()


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """What a camera sees, for the fleet's file that is written beside its calibration."""
    (tmp_path / "camera.yaml").write_text(SEEN.to_yaml())
    camera = Drawn()
    monkeypatch.setattr(cv2, "VideoCapture", camera)
    yield camera
    camera.over.set()
