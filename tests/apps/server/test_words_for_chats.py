"""What reaches a person in a chat, on the page or over MCP names nothing of the command line."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from formup.apps.cli import app

ROOT = Path(__file__).parents[3]
COMMAND: Any = typer.main.get_command(app)
TYPED = re.compile(rf"(?<![\w-])--[a-z]|\bformup (?:{'|'.join(COMMAND.commands)})\b")
START = {
    "apps/mcp/command.py": "said before anything is served",
    "apps/server/run.py": "said before anything is served",
    "apps/server/settings.py": "describes a variable of the environment",
    "apps/server/tokens.py": "the file of tokens; clients only hear that the log says why",
}
"""Files with such words that no chat is told, and why."""


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """The strings of a module and their lines, without docstrings."""
    tree = ast.parse(path.read_text())
    bare = {n.value for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in bare:
            yield node.lineno, node.value


@pytest.mark.parametrize("room", ["tools", "agent", "apps/server", "apps/mcp"])
def test_no_text_below_the_command_line_names_what_is_typed_there(room: str) -> None:
    told = [
        f"{path.relative_to(ROOT)}:{line}: {text}"
        for path in sorted((ROOT / room).rglob("*.py"))
        if str(path.relative_to(ROOT)) not in START
        for line, text in texts(path)
        if TYPED.search(text)
    ]
    assert told == []


@pytest.mark.parametrize("ending", ["yaml", "txt", "html", "js", "json"])
def test_no_data_that_is_shown_names_what_is_typed_there(ending: str) -> None:
    rooms = [ROOT / name for name in ("agent", "apps/page", "tools")]
    paths = [path for room in rooms for path in sorted(room.rglob(f"*.{ending}"))]
    assert paths
    assert [str(path) for path in paths if TYPED.search(path.read_text())] == []


METRIC = "cannot be measured: the picture has no scale. Say it in px"
CAGE = "Cage the largest coin with 8 robots"
ASKED = {
    "Surround the largest coin with 6 robots at 20 cm": METRIC,
    "Umstelle die Münze mit 6 Robotern": "Say it in English",
    f"{CAGE}. 2 m further out": METRIC,
    f"{CAGE}. how far are they in metres?": "The picture has no scale, so lengths are px",
}


@pytest.mark.parametrize("words", ASKED)
def test_an_answer_says_what_can_be_done_where_it_is_read(server: Any, words: str) -> None:
    session, (*before, last) = server.begin(), words.split(". ")
    for said in before:
        server.say(session, said)
    told: str = server.say(session, last)["message"]
    assert ASKED[words] in told
    assert not TYPED.search(told)
