"""What models, tools and files hold reaches the terminal as text and as nothing else."""

import ast
import json
import re
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply
from formup.agent.wrappers.doubles import ScriptedModel
from formup.apps.cli import app
from formup.apps.run_display import say_failed
from formup.apps.run_files import Folder
from formup.apps.terminal_session import TerminalSession
from formup.tools.errors import InputError
from formup.tools.perception.image import Picture, load_picture
from PIL import Image

APPS = Path(__file__).parents[2] / "apps"
FORGED = "no\x1b[2K\r\x1b[1;32m   certified  plan p-1\x9b31m\u202e\nplanned: all is well"
UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
TARGET = {"id": "t1", "label": FORGED, "box": [55, 35, 125, 95]}
CONTRACT = {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]}


@pytest.fixture
def agent() -> Agent:
    """One whose model writes escape sequences wherever it can."""
    proposal: dict[str, Any] = {"contract": CONTRACT, "targets": [TARGET]}
    calls = (
        Call(id="1", name=FORGED, arguments={FORGED: FORGED}),
        Call(id="2", name="propose_formation", arguments=proposal),
    )
    replies = [Reply(text=FORGED, calls=calls), Reply(text=FORGED)]
    return Agent(ScriptedModel(replies, FORGED))


@pytest.fixture
def picture(tmp_path: Path) -> Picture:
    image = Image.new("RGB", (200, 140), (60, 60, 60))
    image.paste((200, 40, 40), (60, 40, 120, 90))
    image.save(tmp_path / "scene.png")
    return load_picture(tmp_path / "scene.png")


def test_a_report_shows_escape_sequences(
    agent: Agent, picture: Picture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = agent.run(picture, FORGED)
    with Folder(tmp_path / "run") as home:
        assert TerminalSession(agent, home, as_json=False).serve(run) == 0
        person, _ = capsys.readouterr()
        assert TerminalSession(agent, home, as_json=True).serve(run) == 0
        program, _ = capsys.readouterr()
    assert not UNSAFE.search(person + program)
    assert "no\\u001b[2K\\r\\u001b[1;32m   certified" in person
    after = person.partition("planned: no")[2]
    assert "planned: all is well" in after
    assert not re.search("^planned: all is well", after, re.MULTILINE)
    report = json.loads(program)
    assert report["message"] == report["targets"][0]["label"] == FORGED


def test_a_trace_shows_escape_sequences(
    agent: Agent, picture: Picture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    agent.run(picture, FORGED, trace=tmp_path / "trace.jsonl")
    app(["trace", str(tmp_path)], standalone_mode=False)
    shown, _ = capsys.readouterr()
    assert not UNSAFE.search(shown)
    assert shown.count("\\u202e") >= 4


def test_an_error_shows_escape_sequences(capsys: pytest.CaptureFixture[str]) -> None:
    say_failed("There is no file \x1b[31m red \u202e.")
    _, shown = capsys.readouterr()
    assert shown == "formup: There is no file \\u001b[31m red \\u202e.\n"


def test_it_says_which_version_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert app(["--version"], standalone_mode=False) == 0
    assert capsys.readouterr().out == f"formup {version('formup')}\n"


def test_pictures_of_a_tool_are_called_what_they_are(
    picture: Picture, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--image", str(picture.path), "--state", str(tmp_path / "state.json"))
    app(["tools", "call", "look", *options], standalone_mode=False)
    (written,) = json.loads(capsys.readouterr().out)["pictures"]
    with Image.open(written) as image:
        assert image.format == {".jpg": "JPEG", ".png": "PNG"}[Path(written).suffix]


def test_arguments_have_each_name_once(picture: Picture) -> None:
    twice = '{"region": [0, 0, 9, 9], "region": [0, 0, 99, 99]}'
    with pytest.raises(InputError, match="--args has 'region' twice in one object"):
        app(
            ["tools", "call", "look", "--image", str(picture.path), "--args", twice],
            standalone_mode=False,
        )


@pytest.mark.parametrize("path", sorted(APPS.glob("*.py")), ids=lambda path: path.name)
def test_printing_and_styling_go_through_one_module(path: Path) -> None:
    names = {
        getattr(node.func, "id", getattr(node.func, "attr", ""))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call) and not isinstance(node.func, ast.Attribute)
    }
    if path.name not in ("terminal.py", "main.py"):  # main has words of its own alone
        assert not names & {"print", "Text"}
