"""The prompts of two arms side by side: found by their hashes, a draft also after its release."""

from datetime import date
from pathlib import Path

import pytest
from formup.evals.experiments.trials import Arm
from formup.evals.report.prompt_diff import prompt_diff
from formup.prompts import PromptLibrary
from formup.prompts.release import new_draft, release


@pytest.fixture
def library(shipped: Path, tmp_path: Path) -> PromptLibrary:
    """Prompts of one's own with a draft that says something else."""
    assert shipped
    made = PromptLibrary(tmp_path / "mine")
    draft = new_draft(made, "former@draft-x")
    text = draft.read_text("utf-8")
    draft.write_text(text.replace("8 to 12 vertices", "6 to 9 vertices"), "utf-8")
    return made


def arm(library: PromptLibrary, name: str, sha256: str | None = None) -> Arm:
    prompt = library.load(name)
    return Arm(method="agent", prompt=name, sha256=sha256 or prompt.sha256, model="m")


def test_a_draft_is_found_before_and_after_its_release(library: PromptLibrary) -> None:
    sides = arm(library, "former@v002"), arm(library, "former@draft-x")
    before = prompt_diff(*sides, library)
    assert any(line.startswith("-") and "8 to 12 vertices" in line for line in before)
    assert any(line.startswith("+") and "6 to 9 vertices" in line for line in before)
    assert release(library, "former@draft-x", "why", date(2026, 1, 2)) == "former@v003"
    after = prompt_diff(*sides, library)
    assert after[-4:] == before[-4:]
    assert "+++ former@v003 text" in after


def test_a_text_that_is_gone_is_said_to_be(library: PromptLibrary) -> None:
    sides = arm(library, "former@v002"), arm(library, "former@draft-x", "0" * 64)
    (line,) = prompt_diff(*sides, library)
    assert "The text of former@draft-x as it was tried is not among" in line


def test_one_text_has_no_difference(library: PromptLibrary) -> None:
    same = arm(library, "former@v002")
    assert prompt_diff(same, same, library) == []
    assert prompt_diff(same, Arm(method="rules", model="offline"), library) == []
