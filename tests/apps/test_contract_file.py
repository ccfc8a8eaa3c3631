"""A contract from a file is carried out as it stands; a question shows the one that would do."""

import json
import re
import sys
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply
from formup.agent.session import Run
from formup.agent.wrappers.doubles import ScriptedModel
from formup.apps.main import main
from formup.apps.run_display import show_report
from formup.apps.run_files import Folder, write_files
from formup.tools.perception.image import load_picture
from PIL import Image
from rich.console import Console

ROOT = Path(__file__).parents[2]
BOX = ("--box", "55,35,125,95")
RING = {"relation": "around", "targets": ["t1"], "robots": 6}
Cli = Callable[..., tuple[int, str, str]]


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "scene.png")
    return tmp_path / "scene.png"


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["formup", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        assert isinstance(ended.value.code, int)
        out, err = capsys.readouterr()
        return ended.value.code, out, err

    return run


def written(folder: Path, *groups: dict[str, Any], **more: Any) -> Path:
    (folder / "contract.json").write_text(json.dumps({"groups": groups, **more}))
    return folder / "contract.json"


def test_the_page_shows_the_contract_that_it_runs() -> None:
    page = (ROOT / "docs/contracts.md").read_text("utf-8")
    block = re.search(r"```json\n(.*?)```", page, re.DOTALL)
    assert block is not None
    assert block[1] == (ROOT / "docs/contract.json").read_text("utf-8")


def test_it_is_used_as_it_stands_and_where_the_words_differ_is_said(
    cli: Cli, picture: Path, tmp_path: Path
) -> None:
    group = RING | {"clearance": [10, 14], "min_spacing": 20}
    path = written(tmp_path, group, robot_radius=2)
    code, out, _ = cli(
        "run", picture, "Put nine robots at its corners", *BOX, "--contract", path, "--json"
    )
    data = json.loads(out)
    assert (code, data["status"], len(data["positions"])) == (0, "deployed", 6)
    for name, value in group.items():
        assert data["contract"]["groups"][0][name] == value
    assert data["contract"]["robot_radius"] == 2
    assert "where the words differ" in data["message"]
    assert "9 robots" in data["message"]
    assert "corners" in data["message"]


def test_no_words_are_read(cli: Cli, picture: Path, tmp_path: Path) -> None:
    path = written(tmp_path, RING)
    code, out, _ = cli(
        "run", picture, "Hullabaloo!", *BOX, "--contract", path, "--json", "--plan-only", "-n", 6
    )
    data = json.loads(out)
    assert (code, data["status"]) == (0, "planned")
    assert "differ" not in data["message"]


def test_a_thing_in_the_picture_is_named_by_its_id(cli: Cli, picture: Path, tmp_path: Path) -> None:
    path = written(tmp_path, RING | {"targets": ["c1"]})
    code, out, _ = cli("run", picture, "Ring it", "--contract", path, "--json", "--plan-only")
    data = json.loads(out)
    assert (code, data["contract"]["groups"][0]["targets"]) == (0, ["t1"])
    assert data["targets"][0]["box"] == pytest.approx([59.5, 39.5, 119.5, 89.5], abs=2)
    path = written(tmp_path, RING, RING | {"targets": ["c1"], "clearance": [30, 34]})
    code, out, _ = cli("run", picture, "Ring it", *BOX, "--contract", path, "--json", "--plan-only")
    assert [t["id"] for t in json.loads(out)["targets"]] == ["t1", "t2"]


def test_it_may_name_what_is_to_be_kept_free(cli: Cli, picture: Path, tmp_path: Path) -> None:
    path = written(tmp_path, RING, keep_out=["k1"])
    words = ("run", picture, "Ring it", *BOX, "--contract", path, "--json", "--plan-only")
    code, out, _ = cli(*words, "--keep-out", "150,0,190,139")
    data = json.loads(out)
    assert (code, data["status"], data["contract"]["keep_out"]) == (0, "planned", ["k1"])
    assert all(x < 150 for x, _ in data["positions"])
    code, out, _ = cli(*words)
    assert (code, "'k1'" in json.loads(out)["message"]) == (2, True)


def test_what_cannot_be_met_is_impossible_and_nothing_else_is_tried(
    cli: Cli, picture: Path, tmp_path: Path
) -> None:
    drawn = {"relation": "shape", "shape": {"kind": "grid", "where": "left"}}
    path = written(tmp_path, RING | drawn | {"robots": 3000})
    words = ("Draw a grid by it", *BOX, "--contract", path, "--json")
    code, out, _ = cli("run", picture, *words)
    data = json.loads(out)
    assert (code, data["status"]) == (3, "impossible")
    assert data["usage"]["tool_calls"] == 2


@pytest.mark.parametrize(
    ("content", "options", "said"),
    [
        (None, (), "No such file"),
        ("{", (), "Invalid JSON"),
        ("[1]", (), "is not a valid contract"),
        ('{"groups": []}', (), "groups"),
        ('{"groups": [{"relation": "ring", "robots": 0}]}', (), "robots"),
        ('{"groups": [{"relation": "around", "targets": ["t1"], "robots": 3}], "x": 1}', (), "x"),
        (json.dumps({"groups": [RING | {"targets": ["t7"]}]}), (), "'t7', which nothing points at"),
        (json.dumps({"groups": [RING | {"targets": ["c9"]}]}), (), "no candidate 'c9'"),
        (json.dumps({"groups": [RING]}), ("-n", 5), "6 robots"),
        (json.dumps({"groups": [RING]}), ("--clearance", 5), "--clearance"),
        (json.dumps({"groups": [RING]}), ("--robot-radius", 0), "--robot-radius"),
        (json.dumps({"groups": [RING]}), ("--model", "openai:x"), "--model"),
        (json.dumps({"groups": [RING | {"clearance": [1, 2]}], "unit": "m"}), (), '"unit"'),
        (json.dumps({"groups": [RING | {"clearance": [1, 2]}]}), ("--metres-per-pixel", 1), "unit"),
    ],
)
def test_every_mistake_is_one_sentence(
    cli: Cli,
    picture: Path,
    tmp_path: Path,
    content: str | None,
    options: tuple[Any, ...],
    said: str,
) -> None:
    if content is not None:
        (tmp_path / "c.json").write_text(content)
    code, out, err = cli("run", picture, "Ring it", *BOX, "--contract", "c.json", *options)
    assert (code, out) == (2, "")
    assert err.startswith("formup: ")
    assert err.count("\n") == 1
    assert said in err
    assert not (tmp_path / "formup-runs").exists()


def asked(name: str, picture: Path, folder: Path) -> tuple[Agent, Run]:
    """An agent whose model ends its turn by a call with a contract, and that run."""
    said = {"question": "As c1?"} if name == "ask_user" else {"reason": "No."}
    contract = {"groups": [RING | {"targets": ["c1"]}]}
    call = Call(id="1", name=name, arguments=said | {"contract": contract})
    agent = Agent(ScriptedModel([Reply(calls=(call,)), Reply(text="Well then.")]))
    return agent, agent.run(load_picture(picture), "Ring it in a V", trace=folder / "trace.jsonl")


@pytest.mark.parametrize("name", ["ask_user", "report_impossible"])
def test_a_question_or_refusal_shows_the_contract_that_would_do(
    cli: Cli, picture: Path, tmp_path: Path, name: str
) -> None:
    folder = Folder(tmp_path / "out")
    agent, run = asked(name, picture, folder.path)
    files = write_files(folder, run)
    assert files["contract"] == "contract.json"
    report = run.report.model_copy(update={"files": files})
    assert report.contract is not None
    console = Console(width=60, record=True, file=StringIO())
    show_report(console, report, "out")
    shown = next(line for line in console.export_text().splitlines() if "would do" in line)
    assert json.loads(shown.split("would do")[1]) == {"groups": [RING | {"targets": ["c1"]}]}
    path = tmp_path / "out/contract.json"
    code, out, _ = cli("run", picture, "Ring it in a V", "--contract", path, "--json")
    assert (code, json.loads(out)["status"]) == (0, "deployed")
    if name == "ask_user":
        later = agent.resume(run, answer="no")
        assert "contract" not in write_files(folder, later)
        assert later.report.contract is None
        assert not path.exists()


def test_models_are_not_told_of_it() -> None:
    for tool in Agent(ScriptedModel([])).tools:
        if tool.kind in ("ask", "end"):
            assert "contract" not in tool.schema["properties"]


def test_a_single_tool_call_draws_what_it_made(cli: Cli, picture: Path, tmp_path: Path) -> None:
    arguments = {
        "contract": {"groups": [RING]},
        "targets": [{"id": "t1", "box": [55, 35, 125, 95]}],
    }
    call = ("tools", "call", "propose_formation", "--image", picture, "--picture", "plan.png")
    code, out, _ = cli(*call, "--args", json.dumps(arguments))
    assert (code, json.loads(out)["pictures"]) == (0, ["plan.png"])
    with Image.open(tmp_path / "plan.png") as image:
        assert image.format == "PNG"
    _, out, _ = cli("tools", "call", "look", "--image", picture)
    (name,) = json.loads(out)["pictures"]
    with Image.open(tmp_path / name) as image:
        assert image.format == {"jpg": "JPEG", "png": "PNG"}[name.rpartition(".")[2]]
