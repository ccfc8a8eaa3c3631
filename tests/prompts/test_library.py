"""Where prompts are found, what an id alone means, and that what was released stays so."""

import shutil
from pathlib import Path

import pytest
from formup.prompts import PromptError, PromptLibrary, load_prompt

pytestmark = pytest.mark.usefixtures("shipped")


@pytest.fixture
def own(shipped: Path, tmp_path: Path) -> Path:
    """A folder with all that ships, as `new` would copy it."""
    return shutil.copytree(shipped, tmp_path, dirs_exist_ok=True)


def draft(folder: Path, name: str, body: str = "Do it.", head: str = "") -> None:
    id, _, tag = name.partition("@")
    (folder / id).mkdir(parents=True, exist_ok=True)
    text = f"---\nid: {id}\nsummary: For tests.\n{head}---\n{body}\n"
    (folder / id / f"{tag}.prompt.md").write_text(text, "utf-8")


def test_an_id_alone_is_what_current_names_not_the_highest(own: Path) -> None:
    assert load_prompt("former").name == "former@v002"
    (own / "former/CURRENT").write_text("v001\n")
    assert PromptLibrary(own).load("former").name == "former@v001"


@pytest.mark.parametrize("content", ["v009\n", "draft-x\n", "", "../x"])
def test_current_must_name_a_released_version(own: Path, content: str) -> None:
    draft(own, "former@draft-x")
    (own / "former/CURRENT").write_text(content)
    with pytest.raises(PromptError, match="CURRENT does not name a released version"):
        PromptLibrary(own).load("former")
    assert PromptLibrary(own).load("former@v001").version == 1


def test_without_current_a_version_must_be_named(own: Path) -> None:
    (own / "former/CURRENT").unlink()
    with pytest.raises(PromptError, match="CURRENT is not there; name a version"):
        PromptLibrary(own).load("former")


@pytest.mark.parametrize("name", ["former@v999", "former@", "@v001", "", "../former@v001", "x"])
def test_unknown_names_are_told_what_there_is(name: str) -> None:
    with pytest.raises(PromptError, match=r"Unknown prompt .*former@v001, former@v002"):
        load_prompt(name)


def test_a_released_file_that_changed_is_refused(own: Path) -> None:
    path = own / "former/v002.prompt.md"
    path.write_text(path.read_text("utf-8").replace("4 do", "5 do"), "utf-8")
    with pytest.raises(PromptError, match=r"v002\.prompt\.md was changed after it was released"):
        PromptLibrary(own).load("former")
    assert PromptLibrary(own).load("former@v001").name == "former@v001"


def test_tools_and_inputs_are_released_with_the_text(own: Path) -> None:
    path = own / "former/v002.prompt.md"
    path.write_text(path.read_text("utf-8").replace("tools: [look, ", "tools: ["), "utf-8")
    with pytest.raises(PromptError, match="was changed after it was released"):
        PromptLibrary(own).load("former")


def test_line_ends_of_another_system_are_no_change(own: Path) -> None:
    path = own / "former/v002.prompt.md"
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert PromptLibrary(own).load("former").sha256 == load_prompt("former@v002").sha256


def test_a_version_that_was_never_released_is_refused(own: Path) -> None:
    path = own / "former/v002.prompt.md"
    text = path.read_text("utf-8").replace("version: 2", "version: 3")
    (own / "former/v003.prompt.md").write_text(text, "utf-8")
    with pytest.raises(PromptError, match="was never released"):
        PromptLibrary(own).load("former@v003")


@pytest.mark.parametrize("content", ["{", "[]", '{"former@v002": {}}', "{'x"])
def test_a_damaged_lock_is_refused(own: Path, content: str) -> None:
    (own / "LOCK.json").write_text(content)
    with pytest.raises(PromptError, match=r"LOCK\.json is damaged"):
        PromptLibrary(own).load("former@v001")


def test_an_id_of_ones_own_wins_as_a_whole(tmp_path: Path) -> None:
    draft(tmp_path, "former@draft-x", "Mine.")
    library = PromptLibrary(tmp_path)
    names = library.names()
    assert "former@draft-x" in names
    assert "former@v001" not in names
    assert {"context@v001", "former-direct@v001", "repair@v001"} < set(names)
    assert library.load("former@draft-x").text == "Mine.\n"
    assert library.load("context").name == "context@v001"
    with pytest.raises(PromptError, match="Unknown prompt 'former@v001'"):
        library.load("former@v001")
    assert load_prompt("former@v001").version == 1


def test_a_draft_may_change(tmp_path: Path) -> None:
    for body in ("One.", "Two."):
        draft(tmp_path, "mine@draft-x", body)
        prompt = PromptLibrary(tmp_path).load("mine@draft-x")
        assert (prompt.text, prompt.version) == (f"{body}\n", "draft-x")


def test_a_folder_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    for path in (tmp_path / "nowhere", tmp_path / "file"):
        with pytest.raises(PromptError, match="is no folder of prompts"):
            PromptLibrary(path).load("former")


@pytest.mark.parametrize("content", [b"\xff\xfe", b"x" * 2_000_000])
def test_what_is_no_text_is_refused(tmp_path: Path, content: bytes) -> None:
    draft(tmp_path, "mine@draft-x")
    (tmp_path / "mine/draft-x.prompt.md").write_bytes(content)
    with pytest.raises(PromptError, match=r"draft-x\.prompt\.md"):
        PromptLibrary(tmp_path).load("mine@draft-x")


def test_a_partial_that_is_missing_is_named(tmp_path: Path) -> None:
    draft(tmp_path, "mine@draft-x", "{{frame}}", "include: [frame@v001]\n")
    with pytest.raises(PromptError, match=r"v001\.md cannot be read"):
        PromptLibrary(tmp_path).load("mine@draft-x")
