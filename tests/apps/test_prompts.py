"""`formup prompts` from the command line, and runs with prompts of one's own."""

import json
import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Reply
from formup.agent.model import Request
from formup.agent.providers.remote import RemoteModel
from formup.apps.main import main
from formup.prompts import PromptLibrary, load_prompt
from formup.prompts.release import new_draft
from formup.tools.errors import InputError
from PIL import Image

ROOT = Path(__file__).parent.parent.parent
Cli = Callable[..., tuple[int, str, str]]
WHY = ("--why", "a reason")


@pytest.fixture
def cli_as_shipped(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Cli:
    monkeypatch.setenv("FORMUP_PROMPTS", "mine")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["formup", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, out, err

    return run


@pytest.fixture
def cli(shipped: Path, cli_as_shipped: Cli) -> Cli:
    """With prompts that stay as they are in the place of those that ship."""
    return cli_as_shipped


def done(outcome: tuple[int, str, str]) -> str:
    code, out, err = outcome
    assert (code, err) == (0, "")
    return out


def refused(outcome: tuple[int, str, str], *words: str) -> None:
    code, out, err = outcome
    assert (code, out, err.count("\n")) == (2, "", 1), outcome
    for word in words:
        assert word in err


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")


def comparison(path: Path, old: str, new: str, **changes: Any) -> Path:
    library = PromptLibrary(path.parent / "mine")
    sides = {
        key: {"prompt": name, "sha256": library.load(name).sha256}
        for key, name in (("a", old), ("b", new))
    }
    path.write_text(json.dumps({**sides, "suite": "dev", "verdict": "pass", **changes}))
    return path


def test_the_page_about_prompts_runs_as_written(cli_as_shipped: Cli, tmp_path: Path) -> None:
    page = (ROOT / "docs/prompts.md").read_text("utf-8")
    assert not re.search("|".join(f"{id}@v[0-9]" for id in PromptLibrary().ids()), page)
    blocks = re.findall(r"```console\n(.*?)```", page.partition("## Half an hour")[0], re.DOTALL)
    commands = [line.removeprefix("$ formup ") for block in blocks for line in block.splitlines()]
    shown: list[tuple[str, str]] = []
    for number, words in enumerate(map(shlex.split, commands), start=1):
        if words[1] == "promote":
            comparison(tmp_path / "comparison.json", "rough@v001", "rough@v002")
        shown.append((words[1], done(cli_as_shipped(*words))))
        if words[1] == "new":
            draft = tmp_path / "mine/rough" / f"{words[2].partition('@')[2]}.prompt.md"
            edit(draft, "hypothesis:", "hypothesis: More of this do.")
            draft.write_text(f"{draft.read_text('utf-8')}Change {number}.\n", "utf-8")
    verbs = "new lint diff render release list new release promote log tree"
    assert " ".join(verb for verb, _ in shown) == verbs
    _, lint, diff, render, first, listed, _, second, _, log, tree = (out for _, out in shown)
    assert lint == "0 errors, 0 warnings\n"
    assert "+Change 1.\n" in diff
    assert render == f"{load_prompt('former').render()}Change 1.\n"
    assert (first, second) == ("rough@v001\n", "rough@v002\n")
    assert re.search(r"\* +rough@v001", listed)
    assert "v002 current: passed on dev against rough@v001" in log
    parent = re.escape(load_prompt("former").name)
    assert re.search(f"── {parent} .*\n.*── rough@v001 .*\n.*── rough@v002 [*]", tree)
    assert PromptLibrary(tmp_path / "mine").load("rough").name == "rough@v002"


def test_show_gives_hashes_and_the_file(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    former = load_prompt("former")
    out = done(cli("prompts", "show", "former"))
    assert out.endswith(former.source)
    assert out.splitlines()[:3] == [
        "former@v002",
        f"text {former.sha256}",
        f"file {former.file_sha256}",
    ]


def test_render_takes_values_by_type(cli: Cli, tmp_path: Path) -> None:
    done(cli("prompts", "new", "mine@draft-x"))
    kinds = "{n: {type: integer, max: 9}, ok: {type: boolean}, how: {type: string}}"
    path = tmp_path / "mine/mine/draft-x.prompt.md"
    edit(path, "---\nSay", f"inputs: {kinds}\n---\n{{{{n}}}} {{{{ok}}}} {{{{how}}}} Say")
    name = ("prompts", "render", "mine@draft-x")
    out = done(cli(*name, "--var", "n=3", "--var", "ok=true", "--var", "how=4=5"))
    assert out.startswith("3 true 4=5 Say")
    refused(cli(*name, "--var", "n=10", "--var", "ok=yes"), "10 is above 9", "'yes'", "how")
    refused(cli(*name, "--var", "m=1"), "no input 'm'", "n (integer)")
    refused(cli(*name, "--var", "n"), "NAME=VALUE")
    refused(cli(*name, "--var", "n=1", "--var", "n=2"), "given twice")
    with pytest.raises(InputError, match=r"how \(string\) is missing"):
        Agent(prompt="mine@draft-x", library=PromptLibrary(tmp_path / "mine"))


def test_list_and_lint_for_programs(cli: Cli, tmp_path: Path) -> None:
    done(cli("prompts", "new", "former@draft-x"))
    edit(tmp_path / "mine/former/v001.prompt.md", "You decide", "They decide")
    rows = {row["name"]: row for row in json.loads(done(cli("prompts", "list", "--json")))}
    assert [n for n, row in rows.items() if row["current"]] == [
        *("context@v001", "former@v002", "former-direct@v001", "repair@v001")
    ]
    assert "was changed" in rows["former@v001"]["error"]
    assert rows["former@v002"]["sha256"] == load_prompt("former").sha256
    assert rows["former@draft-x"]["parent"] == "former@v002"
    code, out, err = cli("prompts", "lint", "--json")
    assert (code, err) == (1, "")
    found = [(f["prompt"], f["rule"], f["severity"]) for f in json.loads(out)]
    assert found == [
        ("former@draft-x", "hypothesis", "warning"),
        ("former@v001", "unusable", "error"),
    ]
    code, out, _ = cli("prompts", "lint")
    assert code == 1
    assert out.endswith("1 errors, 1 warnings\n")
    assert "was changed" in out
    done(cli("prompts", "lint", "former"))


def test_nothing_with_an_error_is_released(cli: Cli, tmp_path: Path) -> None:
    done(cli("prompts", "new", "mine@draft-x"))
    leak = "Surround the red car at the corners, such as at (320.0, 124.5).  "
    edit(tmp_path / "mine/mine/draft-x.prompt.md", "Say here", leak)
    words = ("not released", "ends in spaces", "'surround the red car at'", "320.0, 124.5")
    edit(tmp_path / "mine/mine/draft-x.prompt.md", " what", "\nwhat")
    refused(cli("prompts", "release", "mine@draft-x", *WHY), *words)
    assert not (tmp_path / "mine/LOCK.json").exists()


def test_a_report_of_a_draft_works_after_its_release(cli: Cli, tmp_path: Path) -> None:
    done(cli("prompts", "new", "former@draft-x"))
    edit(tmp_path / "mine/former/draft-x.prompt.md", "8 to 12 vertices", "6 to 9 vertices")
    report = comparison(tmp_path / "comparison.json", "former@v002", "former@draft-x")
    other = comparison(tmp_path / "other.json", "former@v002", "former@v001")
    release = ("prompts", "release", "former@draft-x", *WHY, "--report")
    refused(cli(*release, other), "judges former@v001", "not former@draft-x")
    assert done(cli(*release, report)) == "former@v003\n"
    assert "released: a reason (pass on dev against former@v002)" in done(
        cli("prompts", "log", "former")
    )
    promoted = cli("prompts", "promote", "former@v003", "--report", report)
    assert done(promoted) == "former is now former@v003\n"


def test_a_draft_that_was_blocked_is_released_with_a_word_about_it(
    cli: Cli, tmp_path: Path
) -> None:
    done(cli("prompts", "new", "former@draft-x"))
    edit(tmp_path / "mine/former/draft-x.prompt.md", "8 to 12 vertices", "6 to 9 vertices")
    names = "former@v002", "former@draft-x"
    report = comparison(tmp_path / "comparison.json", *names, verdict="block")
    code, out, err = cli("prompts", "release", "former@draft-x", *WHY, "--report", report)
    assert (code, out) == (0, "former@v003\n")
    assert "former@v003 is released, but has not passed: block on dev against former@v002." in err
    assert "(block on dev against former@v002)" in done(cli("prompts", "log", "former"))
    refused(cli("prompts", "promote", "former@v003", "--report", report), "verdict is 'block'")


COMPARED = ("former@v002", "former@v003")
REPORTS: list[tuple[dict[str, Any], tuple[str, ...]]] = [
    ({"verdict": "block"}, ("verdict is 'block'",)),
    ({"verdict": "inconclusive"}, ("verdict is 'inconclusive'",)),
    ({"b": {"prompt": "former@v003", "sha256": "0" * 64}}, ("its b is another text",)),
    (
        {"a": {"prompt": "former@v001", "sha256": "0"}},
        ("its a is former@v001, not former@v002, the current version",),
    ),
    (
        {
            "a": {"prompt": "former@v003", "sha256": "0"},
            "b": {"prompt": "former@v002", "sha256": "0"},
            "verdict": "x",
        },
        ("its a is former@v003", "its b is former@v002", "verdict is 'x'"),
    ),
    ({"a": None, "suite": 3}, ("is no report", "a:", "suite:")),
    (
        {"b": {"prompt": "former@v003", "sha256": "0" * 64, "without": "certificate"}},
        ("its b was tried without certificate", "its b is another text"),
    ),
]


@pytest.fixture
def released(cli: Cli, tmp_path: Path) -> Path:
    done(cli("prompts", "new", "former@draft-x"))
    edit(tmp_path / "mine/former/draft-x.prompt.md", "8 to 12 vertices", "6 to 9 vertices")
    done(cli("prompts", "release", "former@draft-x", *WHY))
    return tmp_path


@pytest.mark.parametrize(("changes", "words"), REPORTS)
def test_a_comparison_that_does_not_allow_it_is_refused(
    changes: dict[str, Any], words: tuple[str, ...], cli: Cli, released: Path
) -> None:
    report = comparison(released / "comparison.json", *COMPARED, **changes)
    refused(cli("prompts", "promote", "former@v003", "--report", report), *words)
    assert (released / "mine/former/CURRENT").read_text() == "v002\n"
    assert "v003 current" not in (released / "mine/former/CHANGELOG.md").read_text()


def test_a_promotion_needs_a_comparison_or_a_reason(cli: Cli, released: Path) -> None:
    promote = ("prompts", "promote", "former@v003")
    (released / "broken.json").write_text("{")
    refused(cli(*promote), "--report FILE", "--force")
    refused(cli(*promote, "--force"), "--why")
    refused(cli(*promote, "--report", "nowhere.json"), "nowhere.json")
    refused(cli(*promote, "--report", "broken.json"), "is not JSON")
    report = comparison(released / "comparison.json", *COMPARED)
    refused(cli(*promote, "--report", report, "--force", *WHY), "--report FILE")
    assert done(cli(*promote, "--force", *WHY)) == "former is now former@v003\n"
    assert "v003 current: forced: a reason" in done(cli("prompts", "log", "former"))
    refused(cli(*promote, "--force", *WHY), "is the current version already")


def test_scores_stand_beside_the_lineage(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    path = tmp_path / "baselines.json"
    path.write_text('{"former@v002": {"photos": 0.8125}}')
    assert "photos 0.812" in done(cli("prompts", "tree", "--baselines", path))
    path.write_text("[1]")
    refused(cli("prompts", "tree", "--baselines", path), "must hold", "SUITE")


MISTAKES = [
    (("show", "former@v009"), "Unknown prompt 'former@v009'"),
    (("log", "x"), "Unknown prompt 'x'"),
    (("diff", "former", "x"), "Unknown prompt 'x'"),
    (("new", "X"), "no name for a draft"),
    (("release", "former", *WHY), "is no draft"),
    (("lint", "former@draft-y"), "Unknown prompt 'former@draft-y'"),
    (("tree", "--prompts", "nowhere"), "nowhere is no folder of prompts"),
]


@pytest.mark.parametrize(("arguments", "words"), MISTAKES)
def test_mistakes_are_one_sentence(
    arguments: tuple[str, ...], words: str, cli: Cli, tmp_path: Path
) -> None:
    (tmp_path / "mine").mkdir()
    refused(cli("prompts", *arguments), words)


def test_without_a_folder_of_ones_own_nothing_is_written(
    cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORMUP_PROMPTS", "")
    assert "former@v002" in done(cli("prompts", "list"))
    refused(cli("prompts", "new", "former"), "--prompts DIR")
    monkeypatch.delenv("FORMUP_PROMPTS")
    refused(cli("prompts", "promote", "former@v001", "--force", *WHY), "--prompts DIR")


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    path = tmp_path / "scene.png"
    Image.fromarray(pixels).save(path)
    return path


ASKED = {"question": "Which one?"}


def test_a_run_is_told_a_draft_and_says_so(
    cli: Cli, picture: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    told: list[str] = []

    async def reply(self: object, request: Request) -> Reply:
        told.append(request.system)
        calls = [] if len(told) > 1 else [{"id": "q", "name": "ask_user", "arguments": ASKED}]
        return Reply.model_validate({"text": "Nothing to do.", "calls": calls})

    monkeypatch.setattr(RemoteModel, "reply", reply)
    monkeypatch.setenv("OPENAI_API_KEY", "none")
    draft = new_draft(PromptLibrary(tmp_path / "mine"), "former@draft-x")
    edit(draft, "8 to 12 vertices", "6 to 9 vertices")
    run = ("run", picture, "Surround it", "--model", "openai:m", "--prompt", "former@draft-x")
    code, out, err = cli(*run, "--json", "--out", "out")
    assert code == 3, err
    made = PromptLibrary(tmp_path / "mine").load("former@draft-x")
    assert json.loads(out)["prompt"] == made.facts
    assert json.loads(out)["prompt"]["version"] == "draft-x"
    assert told == [made.text]
    assert "former@draft-x" in done(cli("trace", "out"))
    edit(draft, "6 to 9 vertices", "5 to 9 vertices")
    monkeypatch.setenv("FORMUP_PROMPTS", "")  # the trace knows where the draft lies
    refused(cli("resume", "out", "--answer", "the red one"), "has changed since this run began")
    edit(draft, "5 to 9 vertices", "6 to 9 vertices")
    assert cli("resume", "out", "--answer", "the red one")[0] == 0
    assert told == [made.text] * 2


def test_the_current_version_of_ones_own_is_the_default(
    released: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "none")
    library = PromptLibrary(released / "mine")

    def named() -> str | None:
        prompt = Agent("openai:m", library=library).prompt
        return prompt and prompt.name

    assert named() == "former@v002"
    done(cli("prompts", "promote", "former@v003", "--force", *WHY))
    assert named() == "former@v003"
    default = Agent("openai:m").prompt
    assert default is not None
    assert default.name == "former@v002"
