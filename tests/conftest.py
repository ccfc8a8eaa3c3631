"""What tests in several folders stand on."""

from pathlib import Path

import pytest
from formup.prompts import library, release


@pytest.fixture
def shipped(monkeypatch: pytest.MonkeyPatch) -> Path:
    """Prompts that stay as they are, in the place of those that ship and go on: former's current
    version is its v002, and the rest have one."""
    folder = Path(__file__).parent / "prompts/shipped"
    for module in (library, release):
        monkeypatch.setattr(module, "SHIPPED", folder)
    return folder
