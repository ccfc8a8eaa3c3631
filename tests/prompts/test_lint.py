"""Each thing lint looks for, found where it is and nowhere in what ships."""

from pathlib import Path

import pytest
from formup.prompts import PromptError, PromptLibrary
from formup.prompts.lint import lint
from formup.prompts.release import new_draft

HEAD = "id: mine\nsummary: For tests.\nhypothesis: More order.\n"
KEY = "sk-" + "a1B2" * 8


def found(folder: Path, body: str, head: str = HEAD) -> list[tuple[str, str]]:
    (folder / "mine").mkdir(exist_ok=True)
    path = folder / "mine/draft-x.prompt.md"
    path.write_text(f"---\n{head}---\n{body}\n", "utf-8")
    return [(f.severity, f.rule) for f in lint(PromptLibrary(folder), ["mine@draft-x"])]


def test_a_sound_draft_is_clean(tmp_path: Path) -> None:
    assert found(tmp_path, "Draw an outline: pixels, y down. Schöne Grüße, привет.") == []


N = "inputs: {n: {type: integer%s}}\n"
CASES = [
    ("{{m}}", HEAD, ("error", "unusable")),
    ("text", HEAD + N % "", ("error", "unusable")),
    ("{{n}}", HEAD + N % "", ("error", "example")),
    ("text  ", HEAD, ("error", "spaces")),
    ("text", HEAD + "author: x \n", ("error", "spaces")),
    (f"Use {KEY} there", HEAD, ("error", "secret")),
    ("-----BEGIN RSA PRIVATE KEY-----", HEAD, ("error", "secret")),
    ("Place the r\u043ebots", HEAD, ("error", "confusable")),
    ("Place\u00a0them", HEAD, ("error", "confusable")),
    ("Place\u200bthem", HEAD, ("error", "confusable")),
    ("Turn it \u202e round", HEAD, ("error", "confusable")),
    ("\uff30lace them", HEAD, ("error", "confusable")),
    ("word " * 30 + "end", HEAD, ("warning", "line")),
    ("word word word\n" * 500, HEAD, ("warning", "budget")),
    ("Write the coordinates.", HEAD, ("warning", "frame")),
    ("Write the coordinates in pixels.", HEAD, ("warning", "frame")),
    ("Draw 8 to 12 vertices, pixels, y down. Ten vertices do.", HEAD, ("warning", "counts")),
    ("Ask three questions. Ask 4 questions.", HEAD, ("warning", "counts")),
    ("Say {{ name }} here", HEAD, ("warning", "braces")),
    ("Say {{Name}} here", HEAD, ("warning", "braces")),
    ("text", "id: mine\nsummary: x\n", ("warning", "hypothesis")),
    ("text", HEAD + "parent: former@v009\n", ("warning", "parent")),
]


@pytest.mark.parametrize(("body", "head", "finding"), CASES)
def test_what_is_wrong_is_found_and_nothing_else(
    tmp_path: Path, body: str, head: str, finding: tuple[str, str]
) -> None:
    assert found(tmp_path, body, head) == [finding]


FINE = [
    ("{{n}}", HEAD + N % ", example: 3"),
    ("{{n}}", HEAD + N % ", default: 3"),
    ("Ask one question. Say it in one or two sentences.", HEAD),
    ('Answer {"positions": [[x, y], ...]} in pixels, y down.', HEAD),
    ("Draw eight vertices, then 8 vertices: pixels, y down.", HEAD),
]


@pytest.mark.parametrize(("body", "head"), FINE)
def test_what_is_fine_is_left_alone(tmp_path: Path, body: str, head: str) -> None:
    assert found(tmp_path, body, head) == []


def test_all_of_it_is_found_at_once(tmp_path: Path) -> None:
    rules = found(tmp_path, f"{KEY}  \nWrite the coordinates.", "id: mine\nsummary: x\n")
    assert {rule for _, rule in rules} == {"secret", "spaces", "frame", "hypothesis"}


@pytest.mark.usefixtures("shipped")
def test_what_was_released_must_be_there_and_unchanged(tmp_path: Path) -> None:
    library = PromptLibrary(tmp_path)
    new_draft(library, "former@draft-x")
    (tmp_path / "former/v001.prompt.md").unlink()
    path = tmp_path / "former/v002.prompt.md"
    path.write_text(path.read_text("utf-8") + "More.\n", "utf-8")
    (tmp_path / "former/CURRENT").write_text("v001")
    (tmp_path / "former/V3.prompt.md").write_text("x")
    sentences = {f.rule: f.sentence for f in lint(library) if f.severity == "error"}
    assert "former@v001 was released, but its file is gone" in sentences["released"]
    assert "was changed after it was released" in sentences["unusable"]
    assert "does not name a released version" in sentences["current"]
    assert "name" in {f.rule for f in lint(library)}


def test_names_that_are_none_are_refused() -> None:
    for name in ("former@v999", "nothing"):
        with pytest.raises(PromptError, match="Unknown prompt"):
            lint(PromptLibrary(), [name])
