"""The report's file: what is in it, what is not, and that nothing of it is anything but text."""

import json
import re
from collections import Counter
from collections.abc import Callable
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path

import pytest
from formup.apps.cli import app
from formup.tools.errors import InputError

hostile = import_module("hostile")
write_run: Callable[..., Path] = hostile.write_run
SECRET: str = hostile.SECRET
TASKS: int = hostile.TASKS
OURS = {
    *("html", "head", "meta", "title", "style", "body", "main", "header", "section", "h1", "h2"),
    *("h3", "p", "ul", "li", "code", "b", "i", "strong", "small", "span", "div", "table", "thead"),
    *("tbody", "tr", "th", "td", "form", "label", "input", "select", "option", "output", "pre"),
    *("article", "details", "summary", "svg", "defs", "image", "use", "g", "circle", "path"),
    *("line", "script"),
}


class Read(HTMLParser):
    """Elements, attributes and text of a page, and whether what is opened is closed."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags, self.attributes = Counter[str](), list[tuple[str, str, str]]()
        self.open, self.texts = list[str](), list[str]()
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        self.attributes += [(tag, key, value or "") for key, value in attrs]
        if tag not in ("meta", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def values(self, name: str) -> list[str]:
        return [value for _, key, value in self.attributes if key == name]


def formup(*arguments: str | Path) -> int:
    return app([*map(str, arguments)], standalone_mode=False) or 0


def made(out: Path, *arguments: str | Path) -> Read:
    assert formup("eval", "report", *arguments, "--out", out) == 0
    page = out.read_text("utf-8")
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", page)
    return Read(page)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    write_run(folder / "a", "agent", passing=4)
    write_run(folder / "b", "alone", passing=1)
    write_run(folder / "held", "agent", passing=4, split="test")
    return folder


def test_nothing_of_what_others_wrote_becomes_html(runs: Path, tmp_path: Path) -> None:
    for extra in ([], ["--against", runs / "b"]):
        page = made(tmp_path / "page.html", runs / "a", *extra)
        assert not page.open
        assert set(page.tags) <= OURS
        assert page.tags["script"] == page.tags["style"] == page.tags["title"] - _drawn(page) == 1
        assert not [key for _, key, _ in page.attributes if key.startswith("on") or key == "style"]
        assert any("<script>alert(1)</script>" in text for text in page.texts)
        assert any("x</a> \\u202e\\u0000" in text for text in page.texts)


def _drawn(page: Read) -> int:
    """Titles within drawings."""
    return page.tags["title"] - 1


def test_nothing_is_loaded(runs: Path, tmp_path: Path) -> None:
    page = made(tmp_path / "page.html", runs / "a")
    links = page.values("href") + page.values("src")
    assert links
    assert all(link.startswith(("#picture-", "data:image/jpeg;base64,")) for link in links)
    assert not {"link", "iframe", "object", "img", "base"} & set(page.tags)
    (policy,) = [v for v in page.values("content") if "default-src" in v]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    whole = (tmp_path / "page.html").read_text("utf-8")
    style = whole.partition("<style>")[2].partition("</style>")[0]
    assert "url(" not in style
    assert "@import" not in style


def test_a_picture_is_in_it_once(runs: Path, tmp_path: Path) -> None:
    page = made(tmp_path / "page.html", runs / "a", "--against", runs / "b")
    assert sum(link.startswith("data:") for link in page.values("href")) == 1
    assert page.tags["use"] == 2 * 2 * TASKS  # two runs of two trials each


def test_matrix_counts_and_differences(runs: Path, tmp_path: Path) -> None:
    alone = made(tmp_path / "page.html", runs / "a")
    assert "8/12" in alone.texts
    both = made(tmp_path / "page.html", runs / "a", "--against", runs / "b")
    assert {"8/12", "2/12", "−50.0", "B − A"} <= set(both.texts)
    assert any("points" in text for text in both.texts)


def test_robots_slots_and_misses_are_drawn(runs: Path, tmp_path: Path) -> None:
    page = made(tmp_path / "page.html", runs / "a")
    kinds = Counter(page.values("class"))
    key = 1  # in the legend
    failed = 2 * 2  # tasks, trials of each
    assert kinds["wrong"] == failed + key
    assert kinds["right"] == 2 * TASKS * 4 - failed + key
    assert kinds["planned"] == 2 * TASKS * 4 + key
    corners_failed = 2  # task 4, where the fourth corner is bare
    assert kinds["slot empty"] == 2 * (corners_failed + key)
    centres = [float(v) for t, k, v in page.attributes if t == "circle" and k in ("cx", "cy")]
    assert max(centres) <= 159  # a robot outside the picture is drawn at its edge
    assert min(centres) >= 0


def test_transcripts_hold_texts_alone(runs: Path, tmp_path: Path) -> None:
    page = made(tmp_path / "page.html", runs / "a")
    assert page.texts.count("Transcript") == TASKS
    assert page.texts.count("How it ended") == TASKS
    assert any("Go <script>alert(8)</script>" in text for text in page.texts)
    assert any("more characters are in the trace" in text for text in page.texts)


def test_held_out_tasks_show_scores_alone(runs: Path, tmp_path: Path) -> None:
    for extra in ([], ["--against", runs / "b"]):
        page = made(tmp_path / "page.html", runs / "held", *extra)
        assert "8/12" in page.texts
        assert not {"article", "image", "details", "pre"} & set(page.tags)
        assert SECRET not in (tmp_path / "page.html").read_text("utf-8")


def test_what_is_missing_is_said(runs: Path, tmp_path: Path) -> None:
    folder = write_run(tmp_path / "lost", "agent", passing=4)
    for path in (folder / "attempts").iterdir():
        if path.is_file():
            path.write_text("{")
    (folder / "square.png").write_bytes(b"not what it was")
    page = made(tmp_path / "page.html", folder)
    assert page.texts.count("The picture is missing.") == TASKS
    assert page.texts.count("Nothing was placed.") == 2 * TASKS
    assert page.texts.count("The trace cannot be read.") == TASKS
    (folder / "suite.json").unlink()
    with pytest.raises(InputError, match="run the suite again into this folder"):
        formup("eval", "report", folder)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--arm-b", "agent"], "needs --against"),
        (["--arm-a", "nobody"], "fits 0 of them"),
    ],
)
def test_what_cannot_be_shown_is_said(runs: Path, arguments: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        formup("eval", "report", runs / "a", *arguments)


def test_other_suites_are_not_put_side_by_side(runs: Path, tmp_path: Path) -> None:
    other = write_run(tmp_path / "other", "agent", passing=3)
    for name in ("suite.json", "manifest.json", "trials.jsonl"):
        path = other / name
        path.write_text(path.read_text("utf-8").replace("5" * 64, "6" * 64), "utf-8")
    with pytest.raises(InputError, match="trials of two suites"):
        formup("eval", "report", runs / "a", "--against", other)


def test_shards_keep_what_the_report_needs(runs: Path, tmp_path: Path) -> None:
    assert formup("eval", "merge", runs / "a", "--out", tmp_path / "merged") == 0
    assert json.loads((tmp_path / "merged" / "suite.json").read_text("utf-8"))["name"] == "hostile"
    page = made(tmp_path / "page.html", tmp_path / "merged")
    assert "Nothing was placed." not in page.texts
