"""What tests in several folders stand on."""

from pathlib import Path

import pytest
from formup.prompts import library, release
from hypothesis import settings

# A busy machine pauses for longer than any example takes.
settings.register_profile("formup", deadline=None)
settings.load_profile("formup")


@pytest.fixture
def shipped(monkeypatch: pytest.MonkeyPatch) -> Path:
    """Prompts that stay as they are, in the place of those that ship and go on: former's current
    version is its v002, and the rest have one."""
    folder = Path(__file__).parent / "prompts/shipped"
    for module in (library, release):
        monkeypatch.setattr(module, "SHIPPED", folder)
    return folder
