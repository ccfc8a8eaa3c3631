"""`formup sessions`: stored conversations listed, searched, read, forked, exported and deleted."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.session import load_run
from formup.agent.store.places import store_at
from formup.apps.cli import app
from formup.apps.main import main
from formup.tools.context import Settings
from formup.tools.errors import StorageError
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt

RED = TargetPrompt(id="t1", box=(55, 35, 125, 95))
FIRST, SECOND = "Surround the *red* thing", "Surround it with 7 robots, 20 px away"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """A store and the id of a session of two turns in it."""
    address = f"sqlite:///{tmp_path_factory.mktemp('home') / 'talks.db'}"
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    store, agent = store_at(address), Agent()
    stored = store.create()
    settings = Settings(robots=5)
    picture = picture_from_array(pixels)
    run = agent.run(picture, FIRST, pointed=[RED], settings=settings, trace=stored)
    run = agent.say(run, SECOND, pointed=[RED])
    assert run.report.status == "deployed"
    store.close()
    return address, stored.id


@pytest.fixture
def told(made: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> Any:
    """Runs `formup sessions` on that store and returns what it prints."""

    def sessions(*arguments: object) -> str:
        app(["sessions", *map(str, arguments), "--store", made[0]], standalone_mode=False)
        return capsys.readouterr().out

    return sessions


def test_sessions_are_listed_renamed_and_searched(told: Any, made: tuple[str, str]) -> None:
    told("rename", made[1], "coins on Monday")
    (line,) = told("list").splitlines()
    assert line.startswith(made[1]) and "2 turns" in line
    assert line.endswith(f"coins on Monday: {SECOND}")
    assert told("search", "RED") == told("search", "monday") == told("list")
    assert told("search", "triangle") == "There are no sessions.\n"
    (facts,) = json.loads(told("list", "--json"))
    assert (facts["id"], facts["turns"], facts["words"]) == (made[1], 2, SECOND)


def test_a_session_is_shown_step_by_step(told: Any, made: tuple[str, str]) -> None:
    shown = told("show", made[1])
    assert shown.index(FIRST) < shown.index("propose_formation") < shown.index(SECOND)
    assert shown.count("deployed:") == 2


def test_a_fork_keeps_the_original(told: Any, made: tuple[str, str]) -> None:
    store = store_at(made[0])
    before = store.open(made[1]).events()
    fork = told("fork", made[1], "--turn", 1).strip()
    assert load_run(store.open(fork)).report.instruction == FIRST
    assert store.open(made[1]).events() == before
    told("delete", fork)
    with pytest.raises(StorageError):
        store.open(fork)
    store.close()


def test_an_export_is_read_by_people_and_programs_and_opens_again(
    told: Any, made: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told("export", made[1], tmp_path / "copy")
    app(["trace", str(tmp_path / "copy")], standalone_mode=False)
    assert SECOND in capsys.readouterr().out
    run = load_run(tmp_path / "copy")
    assert (run.report.instruction, run.context.picture.size) == (SECOND, (200, 140))
    page = (tmp_path / "copy/session.md").read_text("utf-8")
    assert "Surround the \\*red\\* thing" in page
    for plan in run.world.plans:
        assert (tmp_path / f"copy/pictures/{plan}.png").read_bytes().startswith(b"\x89PNG")
        assert f"(pictures/{plan}.png)" in page
    kept = json.loads((tmp_path / "copy/session.json").read_bytes())
    assert [e["words"] for e in kept["events"] if e["type"] == "turn"] == [FIRST, SECOND]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["show", "nothere"], "'nothere'"),
        (["fork", "ID", "--turn", "9"], "turns 1 to 2"),
        (["export", "ID", "COPY"], "is there already"),
        (["list", "--store", "ftp://x"], "sqlite:///FILE"),
    ],
)
def test_mistakes_are_one_sentence(
    arguments: list[str],
    words: str,
    made: tuple[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    store = [] if "--store" in arguments else ["--store", made[0]]
    (tmp_path / "trace.jsonl").touch()
    words_of = {"ID": made[1], "COPY": str(tmp_path)}
    given = [words_of.get(word, word) for word in arguments]
    monkeypatch.setattr(sys, "argv", ["formup", "sessions", *given, *store])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1


def test_another_process_sees_them(made: tuple[str, str]) -> None:
    command = [sys.executable, "-m", "formup", "sessions", "list", "--store", made[0]]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert made[1] in done.stdout
