"""`formup run --model PROVIDER:NAME`: what a person types, reads and gets as exit code."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.apps.main import main
from formup.prompts import load_prompt
from PIL import Image

Cli = Callable[..., tuple[int, str, str]]
WORDS = "Surround the red thing with 6 robots"
PLAN: dict[str, Any] = {
    "contract": {"groups": [{"relation": "around", "targets": ["t1"], "robots": 6}]},
    "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
}


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "scene.png")

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["formup", "run", "scene.png", WORDS, *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        assert isinstance(ended.value.code, int)
        return ended.value.code, out, err

    return run


def test_a_model_on_another_server(cli: Cli, server: Any, dialect: Any, http: Any) -> None:
    server.script = [
        http.response(dialect.body("", [("c1", "propose_formation", PLAN)], "calls")),
        http.response(dialect.body("Six robots have a place.")),
    ]
    name = ("--model", f"{dialect.name}:m", "--base-url", server.url)
    code, out, err = cli(*name, "--json", "--plan-only")
    assert code == 0, err
    data = json.loads(out)
    assert (data["status"], data["message"]) == ("planned", "Six robots have a place.")
    assert data["model"] == f"{dialect.name}:m"
    former = load_prompt("former")
    assert data["prompt"] == former.facts
    assert data["usage"]["input_tokens"] == 200
    assert data["usage"]["cost_usd"] == 0


def test_a_server_that_fails_is_exit_code_4(cli: Cli, server: Any, dialect: Any, http: Any) -> None:
    server.script = [http.response(dialect.error("no such model"), 404)]
    name = ("--model", f"{dialect.name}:m", "--base-url", server.url)
    code, out, err = cli(*name, "--json")
    assert code == 4, err
    data = json.loads(out)
    assert data["status"] == "failed"
    assert "answered 404 (no such model)" in data["message"]


MISTAKES = [
    (("--model", "openai:m"), "set OPENAI_API_KEY"),
    (("--model", "anthropic:m"), "set ANTHROPIC_API_KEY"),
    (("--model", "openai:m", "--base-url", "nowhere"), "'nowhere' is no base URL"),
    (("--base-url", "http://127.0.0.1:1/v1"), "offline rules ask no server"),
    (("--model", "ollama:m", "--prompt", "x@v1"), "Unknown prompt 'x@v1'"),
]


@pytest.mark.parametrize(("arguments", "words"), MISTAKES)
def test_mistakes_are_one_sentence(
    arguments: tuple[str, ...], words: str, cli: Cli, server: Any
) -> None:
    code, out, err = cli(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("formup: ")
    assert err.count("\n") == 1
    assert words in err
