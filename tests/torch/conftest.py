"""Networks on tiny checkpoints; without torch these tests are skipped, and say so."""

import subprocess
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from formup.tools.perception.image import Picture, picture_from_array
from numpy.typing import NDArray
from PIL import Image

GREY, RED = (200, 200, 200), (200, 30, 30)
BOX = (80, 60, 159, 119)
"""Of the red thing that pictures here show."""
OTHER = (230, 160, 299, 219)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if not (find_spec("torch") and find_spec("transformers")):
        here, reason = Path(__file__).parent, "needs formup[torch]: make test-torch"
        for item in items:
            if here in item.path.parents:
                item.add_marker(pytest.mark.skip(reason=reason))


@pytest.fixture(scope="session", autouse=True)
def offline() -> Iterator[None]:
    """Nobody but this machine is asked, unless a test says so."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HF_HUB_OFFLINE", "1")
        yield


@pytest.fixture(scope="session")
def checkpoints(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of checkpoints, by the names of what runs them."""
    folder = tmp_path_factory.mktemp("checkpoints")
    writer = Path(__file__).with_name("checkpoints.py")
    subprocess.run([sys.executable, writer, folder], check=True, capture_output=True)
    return folder


def drawn(*boxes: tuple[int, int, int, int]) -> NDArray[np.uint8]:
    """Red boxes on grey."""
    pixels = np.full((240, 320, 3), GREY, dtype=np.uint8)
    for x0, y0, x1, y1 in boxes:
        pixels[y0 : y1 + 1, x0 : x1 + 1] = RED
    return pixels


@pytest.fixture
def one_red() -> Picture:
    return picture_from_array(drawn(BOX))


@pytest.fixture
def two_red() -> Picture:
    return picture_from_array(drawn(BOX, OTHER))


@pytest.fixture
def blank() -> Picture:
    return picture_from_array(drawn())


@pytest.fixture
def red_file(tmp_path: Path) -> Path:
    path = tmp_path / "red.png"
    Image.fromarray(drawn(BOX)).save(path)
    return path
