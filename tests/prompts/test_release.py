"""Drafts, releases and promotions: what is written, and what never is."""

import errno
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from datetime import date
from pathlib import Path

import pytest
from formup.prompts import PromptError, PromptLibrary, files
from formup.prompts import release as releases
from formup.prompts.history import diff, lineage, log
from formup.prompts.release import new_draft, promote, release

DAY = date(2026, 11, 25)
pytestmark = pytest.mark.usefixtures("shipped")


@pytest.fixture
def library(tmp_path: Path) -> PromptLibrary:
    return PromptLibrary(tmp_path / "own")


def files_of(folder: Path) -> dict[str, bytes]:
    found = sorted(p for p in folder.rglob("*") if p.is_file())
    return {str(p.relative_to(folder)): p.read_bytes() for p in found}


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")


def test_a_draft_of_a_shipped_id_brings_its_versions_along(
    library: PromptLibrary, shipped: Path
) -> None:
    path = new_draft(library, "former@draft-ring")
    assert library.names() == [
        "context@v001",
        *("former@draft-ring", "former@v001", "former@v002"),
        *("former-direct@v001", "repair@v001"),
    ]
    made = library.load("former@draft-ring")
    assert (made.front.parent, made.front.hypothesis) == ("former@v002", None)
    assert made.sha256 == library.load("former").sha256
    assert path.parent.parent == library.folder
    assert library.home("former") == library.folder
    assert library.home("context") == shipped


def test_a_draft_of_a_new_id_is_a_page_to_fill(library: PromptLibrary) -> None:
    assert [new_draft(library, "mine").name for _ in "ab"] == [
        "draft-1.prompt.md",
        "draft-2.prompt.md",
    ]
    assert library.load("mine@draft-2").front.parent is None


def test_a_draft_can_start_from_another_id(library: PromptLibrary) -> None:
    new_draft(library, "mine@draft-x", "former@v001")
    made = library.load("mine@draft-x")
    assert (made.id, made.front.parent) == ("mine", "former@v001")
    assert made.text == library.load("former@v001").text


def test_a_draft_is_not_overwritten(library: PromptLibrary) -> None:
    edit(new_draft(library, "mine@draft-x"), "Say here", "Keep this")
    with pytest.raises(PromptError, match="is there already"):
        new_draft(library, "mine@draft-x")
    assert "Keep this" in library.load("mine@draft-x").text


@pytest.mark.parametrize(
    "name", ["", "Mine", "a/b", "../x", "partials", "mine@v001", "mine@x", "1"]
)
def test_names_that_are_none_are_refused(library: PromptLibrary, name: str) -> None:
    with pytest.raises(PromptError, match="no name for a draft"):
        new_draft(library, name)


def test_the_first_version_is_current_and_the_next_is_not(library: PromptLibrary) -> None:
    new_draft(library, "mine@draft-x")
    assert release(library, "mine@draft-x", "a  start\nat last", DAY) == "mine@v001"
    assert library.load("mine").name == "mine@v001"
    assert library.load("mine").front.created == DAY
    new_draft(library, "mine@draft-x")
    assert library.load("mine@draft-x").front.parent == "mine@v001"
    assert release(library, "mine@draft-x", "better", DAY) == "mine@v002"
    assert library.load("mine").name == "mine@v001"
    assert library.names()[-3:-1] == ["mine@v001", "mine@v002"]
    assert [(e.name, e.what, e.why) for e in log(library, "mine")] == [
        ("mine@v001", "released", "a start at last"),
        ("mine@v001", "current", "the first version"),
        ("mine@v002", "released", "better"),
    ]


def test_versions_go_on_from_those_shipped(library: PromptLibrary) -> None:
    new_draft(library, "former@draft-x")
    assert release(library, "former@draft-x", "try", DAY) == "former@v003"
    assert library.load("former").name == "former@v002"


def test_all_that_was_written_by_hand_is_kept(library: PromptLibrary) -> None:
    path = new_draft(library, "mine@draft-x")
    head = (
        "# why so\ninputs:\n  n: {type: integer, default: 3}\nhypothesis: |\n  More\n\n  order.\n"
    )
    edit(path, "---\nSay", f"{head}---\nPut {{{{n}}}} there.\nSay")
    release(library, "mine@draft-x", "x", DAY)
    made = library.load("mine@v001")
    assert head in made.source
    assert made.render().startswith("Put 3 there.")
    new_draft(library, "mine@draft-y")
    assert library.load("mine@draft-y").front.hypothesis is None


@pytest.mark.parametrize("why", ["", " \n "])
def test_a_release_needs_a_reason(library: PromptLibrary, why: str) -> None:
    new_draft(library, "mine@draft-x")
    before = files_of(library.folder or Path())
    with pytest.raises(PromptError, match="--why"):
        release(library, "mine@draft-x", why, DAY)
    assert files_of(library.folder or Path()) == before


def test_only_drafts_of_ones_own_are_released(library: PromptLibrary) -> None:
    new_draft(library, "mine@draft-x")
    for name in ("former@v002", "former"):
        with pytest.raises(PromptError, match="only drafts are released"):
            release(library, name, "x", DAY)
    with pytest.raises(PromptError, match="with --prompts DIR"):
        release(PromptLibrary(), "former@draft-x", "x", DAY)


def test_the_prompts_of_an_installed_formup_stay_as_they_are(
    library: PromptLibrary, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    new_draft(library, "mine@draft-x")
    assert library.folder is not None
    monkeypatch.setattr(releases, "SHIPPED", library.folder)
    for write in (
        lambda: new_draft(library, "mine"),
        lambda: release(library, "mine@draft-x", "x", DAY),
        lambda: promote(library, "mine@draft-x", "x", DAY, None),
    ):
        with pytest.raises(PromptError, match="is of the installed formup"):
            write()


def test_a_release_that_cannot_be_locked_leaves_nothing(
    library: PromptLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    new_draft(library, "former@draft-x")
    assert library.folder is not None
    before = files_of(library.folder)

    def full(path: Path, text: str) -> None:
        raise PromptError(f"{path} cannot be written: no space left.")

    monkeypatch.setattr(releases, "write_whole", full)
    with pytest.raises(PromptError, match="no space left"):
        release(library, "former@draft-x", "x", DAY)
    assert files_of(library.folder) == before


def test_a_released_file_is_never_written_over(library: PromptLibrary) -> None:
    new_draft(library, "former@draft-x")
    assert library.folder is not None
    path = library.folder / "former/v002.prompt.md"
    before = path.read_bytes()
    with pytest.raises(PromptError, match="is there already and is not overwritten"):
        files.write_new(path, "other")
    assert path.read_bytes() == before


def test_releases_at_the_same_time_get_versions_of_their_own(library: PromptLibrary) -> None:
    names = [f"mine@draft-{i}" for i in range(8)]
    for name in names:
        edit(new_draft(library, name), "Say here", f"{name}: say here")
    texts = {library.load(name).text for name in names}

    def released_as(name: str) -> str:
        return release(library, name, name, DAY)

    with ThreadPoolExecutor(8) as pool:
        made = list(pool.map(released_as, names))
    assert sorted(made) == [f"mine@v{i:03d}" for i in range(1, 9)]
    assert {library.load(name).text for name in made} == texts
    assert library.folder is not None
    assert sorted(json.loads((library.folder / "LOCK.json").read_text("utf-8"))) == sorted(made)
    released = [e.name for e in log(library, "mine") if e.what == "released"]
    assert sorted(released) == sorted(made)
    left = [p.name for p in library.folder.rglob(".*")]
    assert left == []


def test_who_writes_is_waited_for(library: PromptLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    new_draft(library, "mine@draft-x")
    assert library.folder is not None
    monkeypatch.setattr(files, "PATIENCE", 0.05)
    with (
        files.locked_folder(library.folder),
        pytest.raises(PromptError, match=r"Another process writes in .* try again"),
    ):
        release(library, "mine@draft-x", "x", DAY)
    assert release(library, "mine@draft-x", "x", DAY) == "mine@v001"


KILLED = """
import os, sys
from datetime import date
from pathlib import Path
from formup.prompts import PromptLibrary, release

release._write_lock = lambda *_: os._exit(9)
release.release(PromptLibrary(Path(sys.argv[1])), "mine@draft-x", "x", date(2026, 11, 25))
"""


def test_a_release_whose_process_was_killed_is_told_and_done_again(library: PromptLibrary) -> None:
    new_draft(library, "mine@draft-x")
    assert library.folder is not None
    command = [sys.executable, "-c", KILLED, str(library.folder)]
    assert subprocess.run(command, check=False).returncode == 9
    assert (library.folder / files.BUSY).exists()
    left = library.folder / "mine/v001.prompt.md"
    for torn in (left.read_text("utf-8"), ""):
        left.write_text(torn, "utf-8")
        with pytest.raises(PromptError, match=r"v001.* If a release broke off, delete it and"):
            library.load("mine@v001")
    left.unlink()
    assert release(library, "mine@draft-x", "x", DAY) == "mine@v001"
    assert library.load("mine").name == "mine@v001"
    assert [p.name for p in library.folder.rglob(".*")] == []


def test_a_file_system_without_hard_links_will_do(
    library: PromptLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*_: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(files.os, "link", none)
    new_draft(library, "former@draft-x")
    assert release(library, "former@draft-x", "x", DAY) == "former@v003"
    assert library.load("former@v003").text == library.load("former@v002").text
    assert library.folder is not None
    before = files_of(library.folder)
    with pytest.raises(PromptError, match="is there already and is not overwritten"):
        files.write_new(library.folder / "former/v002.prompt.md", "other")
    monkeypatch.setattr(Path, "replace", none)
    with pytest.raises(PromptError, match="cannot be written: Operation not permitted"):
        files.write_new(library.folder / "former/v004.prompt.md", "other")
    assert files_of(library.folder) == before


def test_partials_are_released_with_what_includes_them(library: PromptLibrary) -> None:
    path = new_draft(library, "mine@draft-x")
    assert library.folder is not None
    partial = library.folder / "partials/frame/v001.md"
    partial.parent.mkdir(parents=True)
    partial.write_text("Pixels, y down.\n")
    edit(path, "---\nSay here", "include: [frame@v001]\n---\n{{frame}} Say here")
    partial.write_text("Pixels, y runs down.\n")  # not released: it may change
    release(library, "mine@draft-x", "x", DAY)
    assert library.load("mine").text.startswith("Pixels, y runs down. Say")
    new_draft(library, "other@draft-x", "mine")
    partial.write_text("Pixels, y up.\n")
    for name in ("mine@v001", "other@draft-x"):
        with pytest.raises(PromptError, match=r"v001\.md was changed after a prompt with it"):
            library.load(name)


def test_promotion_moves_current_and_says_so(library: PromptLibrary) -> None:
    new_draft(library, "former@draft-x")
    release(library, "former@draft-x", "x", DAY)
    promote(library, "former@v003", "passed on dev", DAY, "former@v002")
    assert library.load("former").name == "former@v003"
    last = log(library, "former")[-1]
    assert (last.on, last.name, last.what) == ("2026-11-25", "former@v003", "current")
    assert last.why == "passed on dev"
    promote(library, "former@v002", "back", DAY, None)
    assert library.load("former").name == "former@v002"


def test_promotions_that_make_no_sense_are_refused(library: PromptLibrary) -> None:
    new_draft(library, "former@draft-x")
    assert library.folder is not None
    before = files_of(library.folder)
    for name, after, words in (
        ("former@draft-x", None, "is a draft and cannot be current"),
        ("former@v002", None, "is the current version already"),
        ("former@v001", "former@v001", "is no longer current but v002"),
        ("context@v001", None, "`formup prompts new context` copies it there"),
    ):
        with pytest.raises(PromptError, match=words):
            promote(library, name, "x", DAY, after)
    assert files_of(library.folder) == before


def test_differences_are_of_front_matter_and_text(library: PromptLibrary) -> None:
    edit(new_draft(library, "former@draft-x"), "8 to 12 vertices", "6 to 9 vertices")
    lines = diff(library.load("former"), library.load("former@draft-x"))
    assert "+++ former@draft-x front matter" in lines
    assert "-version: 2" in lines
    assert "--- former@v002 text" in lines
    assert any(line.startswith("+") and "6 to 9 vertices" in line for line in lines)
    same = library.load("former")
    assert diff(same, same) == []


def test_lineage_follows_parents_and_survives_circles(library: PromptLibrary) -> None:
    first, second = new_draft(library, "mine@draft-a"), new_draft(library, "mine@draft-b")
    edit(first, "summary:", "parent: mine@draft-b\nsummary:")
    edit(second, "summary:", "parent: mine@draft-a\nsummary:")
    prompts = [library.load(name) for name in library.names()]
    children = lineage(prompts)
    assert children["former@v001"] == ["former@v002"]
    assert {"mine@draft-a", "mine@draft-b", "former@v001"} <= set(children[None])
    assert sorted(n for names in children.values() for n in names) == sorted(library.names())
