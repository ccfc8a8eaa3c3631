"""`--fleet FILE` reaches whatever moves robots: a run, a chat, a deployment, a server's service."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from formup.apps.main import main
from PIL import Image

RUN = ("Surround it with 5 robots", "--box", "55,35,125,95", "--json")
Cli = Callable[..., tuple[int, str, str]]


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "scene.png")
    (tmp_path / "stuck.yaml").write_text("fleet: simulated\nstuck: [{robot: 3, after: 0.2}]\n")
    (tmp_path / "good.yaml").write_text("fleet: simulated\ndrive: differential\nradius: 2\n")
    (tmp_path / "talk.txt").write_text("Surround it with 5 robots\ngo\n")

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["formup", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        assert isinstance(ended.value.code, int)
        out, err = capsys.readouterr()
        return ended.value.code, out, err

    return run


def test_a_run_on_a_described_fleet_ends_as_its_robots_do(cli: Cli) -> None:
    code, out, _ = cli("run", "scene.png", *RUN, "--fleet", "good.yaml")
    assert (code, json.loads(out)["status"]) == (0, "deployed")
    code, out, _ = cli("run", "scene.png", *RUN, "--fleet", "stuck.yaml")
    data = json.loads(out)
    assert (code, data["status"]) == (4, "failed")
    assert "Robot 3 does not get on" in data["message"]
    assert data["arrival"]["failed"] == ["3"]
    assert data["arrival"]["certified"] is False


def test_a_chat_and_its_service_have_it_too(cli: Cli) -> None:
    chat = ("chat", "scene.png", "--box", "55,35,125,95", "--script", "talk.txt", "--json")
    code, out, _ = cli(*chat, "--store", "sessions", "--fleet", "good.yaml")
    assert code == 0
    assert [json.loads(line)["status"] for line in out.splitlines()] == ["planned", "deployed"]
    code, out, _ = cli(*chat, "--store", "sessions", "--fleet", "stuck.yaml")
    assert code == 4
    assert "Robot 3 does not get on" in json.loads(out.splitlines()[-1])["message"]


def test_a_plan_is_deployed_with_it(cli: Cli) -> None:
    code, _, _ = cli("run", "scene.png", *RUN, "--plan-only", "--out", "plan")
    assert code == 0
    code, out, err = cli("deploy", "plan/plan.json", "--fleet", "stuck.yaml", "--json")
    assert code == 4
    assert "Robot 3 does not get on" in out + err


@pytest.mark.parametrize(
    ("name", "words"),
    [("good.yaml", "there is nothing to be stopped"), ("seen.yaml", "never driven")],
)
def test_what_no_other_program_can_stop_is_told_in_a_sentence(
    cli: Cli, tmp_path: Path, name: str, words: str
) -> None:
    (tmp_path / "seen.yaml").write_text("fleet: recorded\nfile: poses.csv\n")
    code, out, err = cli("fleet", "stop", name)
    assert (code, out, len(err.splitlines())) == (2, "", 1)
    assert f"{name} describes" in err and words in err


def test_a_file_that_describes_none_is_refused_before_anything(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("fleet: simulated\nwings: 2\n")
    for command in (("run", "scene.png", *RUN), ("serve", "--store", "sessions")):
        code, out, err = cli(*command, "--fleet", "bad.yaml")
        assert code == 2
        assert "wings: no such key" in out + err
