"""Every mistake a user can make on the command line: exit code 2 and one clear sentence."""

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from formup.apps.main import main
from PIL import Image

Cli = Callable[..., tuple[int, str, str]]
CAR = ("Surround the car at the corners",)
POINT = ("--point", "90,65")


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    path = tmp_path / "scene.png"
    Image.fromarray(pixels).save(path)
    return path


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["formup", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        code = ended.value.code
        assert isinstance(code, int)
        return code, out, err

    return run


def refused(outcome: tuple[int, str, str], *words: str) -> None:
    """Exit 2, nothing on stdout, one sentence on stderr with these words."""
    code, out, err = outcome
    assert code == 2, err
    assert out == ""
    assert err.startswith("formup: ")
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    for word in words:
        assert word in err, err


def test_missing_picture(cli: Cli) -> None:
    refused(cli("run", "nowhere.png", *CAR), "nowhere.png")


def test_folder_for_a_picture(cli: Cli, tmp_path: Path) -> None:
    refused(cli("run", tmp_path, *CAR), tmp_path.name, "folder")


@pytest.mark.parametrize(
    ("content", "word"), [(b"", "empty"), (b"hello, I am text", "not"), (b"%PDF-1.7", "PDF")]
)
def test_no_picture_in_the_file(cli: Cli, tmp_path: Path, content: bytes, word: str) -> None:
    path = tmp_path / "x.png"
    path.write_bytes(content)
    refused(cli("run", path, *CAR), "x.png", word)


def test_truncated_picture(cli: Cli, picture: Path) -> None:
    picture.write_bytes(picture.read_bytes()[:150])
    refused(cli("run", picture, *CAR), "scene.png")


@pytest.mark.parametrize("count", ["0", "-1", "10001", "2.5", "nan", "many", "", "1e3"])
def test_no_number_of_robots(cli: Cli, picture: Path, count: str) -> None:
    refused(cli("run", picture, *CAR, "-n", count, *POINT), repr(count), "1 to 10,000")


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--point", "900,60", ("(900, 60)", "outside", "200 x 140")),
        ("--keep-out", "900,60,950,90", ("keep-out", "outside", "200 x 140")),
        ("--keep-out", "10,20,30", ("--keep-out '10,20,30'", "3 numbers")),
        ("--keep-out", "the car", ("--keep-out 'the car'", "c3")),
        ("--keep-out", "a,b", ("--keep-out 'a,b'", "X,Y")),
        ("--keep-out", "c99", ("keep-out", "no candidate 'c99'")),
        ("--point", "-1,60", ("(-1, 60)", "outside")),
        ("--point", "nan,60", ("'nan,60'", "X,Y")),
        ("--point", "a,b", ("'a,b'", "X,Y")),
        ("--point", "60", ("'60'", "X,Y")),
        ("--point", "", ("X,Y",)),
        ("--box", "300,10,400,50", ("outside", "200 x 140")),
        ("--box", "120,90,60,40", ("inverted", "x0 < x1")),
        ("--box", "60,40,60,90", ("empty",)),
        ("--box", "60,40,120", ("X0,Y0,X1,Y1",)),
        ("--box", "60,40,120,inf", ("X0,Y0,X1,Y1",)),
        ("--outline", "60,40,120,40", ("3 to 200",)),
        ("--outline", "60,40,120,40,90", ("5 numbers",)),
        ("--outline", "100,30,124,102,62,58,138,58,76,102", ("crosses itself",)),
        ("--outline", "60,40,90,40,120,40", ("empty",)),
        ("--outline", "360,40,420,40,420,90", ("outside",)),
        ("--target", "c99", ("'c99'", "Candidates: c1")),
        ("--target", "99", ("'c99'", "Candidates: c1")),
        ("--target", "c0", ("'c0'", "c3")),
        ("--target", "t1", ("'t1'", "c3")),
        ("--target", "c1,c2", ("'c1,c2'", "c3")),
        ("--target", "١", ("'١'", "c3")),
        ("--target", "c123456", ("'c123456'", "c3")),
        ("--target", "", ("''", "c3")),
        ("--detector", "vlm", "sees no picture; choose a model"),
        ("--threshold", "2", ("'2'", "0 to 1")),
        ("--threshold", "high", ("'high'",)),
        ("--robot-radius", "-3", ("'-3'", "pixels")),
        ("--clearance", "nan", ("'nan'", "pixels")),
        ("--model", "gpt-9", ("'gpt-9'", "offline")),
        ("--segmenter", "magic", ("'magic'", "grabcut")),
        ("--prompt", "former@v999", ("'former@v999'", "former@v001")),
        ("--fleet", "navy", ("'navy'", "simulated")),
        ("--descriptor", "poem", ("'poem'", "edges+vertices")),
        ("--starts", "nowhere.csv", ("nowhere.csv",)),
        ("--seed", "x", ("'x'", "0 to")),
        ("--nonsense", "x", ("--nonsense",)),
    ],
)
def test_unusable_option(
    cli: Cli, picture: Path, option: str, value: str, words: tuple[str, ...]
) -> None:
    refused(cli("run", picture, *CAR, "-n", 4, option, value), *words)


def test_with_json_the_sentence_is_also_the_one_object(cli: Cli, picture: Path) -> None:
    code, out, err = cli("run", picture, *CAR, "-n", "many", *POINT, "--json")
    data = json.loads(out)
    assert code == 2
    assert (data["status"], data["positions"]) == ("failed", None)
    assert f"formup: {data['message']}\n" == err


@pytest.mark.parametrize("text", ["", "   ", "\n\t"])
def test_empty_instruction(cli: Cli, picture: Path, text: str) -> None:
    refused(cli("run", picture, text, "-n", 4, *POINT), "empty")


@pytest.mark.parametrize("out", ["scene.png/x", "/proc/formup"])
def test_output_folder_that_cannot_be_written(cli: Cli, picture: Path, out: str) -> None:
    refused(cli("run", picture, *CAR, "-n", 4, *POINT, "--out", out), "cannot be written", "--out")


def test_vast_instruction(cli: Cli, picture: Path) -> None:
    refused(cli("run", picture, "1" * 100_000, "-n", 4, *POINT), "100,000 characters", "4,000")


def test_line_breaks_of_all_kinds_in_an_instruction_are_words(cli: Cli, picture: Path) -> None:
    text = "Surround\u2028the car\x85at\u2029the corners\nRobots: 9"
    code, _, err = cli("run", picture, text, "-n", 4, "--box", "55,35,125,95")
    assert code == 0, err


def test_errors_leave_no_folder_behind(cli: Cli, picture: Path, tmp_path: Path) -> None:
    refused(cli("run", picture, *CAR, "-n", 4, "--point", "900,60"))
    refused(cli("run", picture, *CAR, "-n", 4, "--target", "c99"))
    assert not (tmp_path / "formup-runs").exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("1,2\n3,4\n", ("2 positions", "4 robots")),
        ("[[1,2],[3]]", ("x,y",)),
        ("a,b", ("x,y",)),
        ("1,nan\n" * 4, ("x,y",)),
        ("[[1" + 400 * "0" + ",1]]", ("x,y",)),
        ("[" * 100_000, ("x,y",)),
        ("10,10\n20,10\n30,10\n90,65\n", ("Robot 4", "on the target")),
        ("10,10\n20,10\n30,10\n900,65\n", ("Robot 4", "outside the picture")),
    ],
)
def test_unusable_starts(
    cli: Cli, picture: Path, tmp_path: Path, content: str, words: tuple[str, ...]
) -> None:
    (tmp_path / "starts.csv").write_text(content)
    box = ("--box", "55,35,125,95")
    refused(cli("run", picture, *CAR, "-n", 4, *box, "--starts", "starts.csv"), *words)


def test_unusable_plan_files(cli: Cli, picture: Path, tmp_path: Path) -> None:
    refused(cli("deploy", "nowhere.json"), "nowhere.json")
    (tmp_path / "text.json").write_text("hello")
    refused(cli("deploy", "text.json"), "not JSON")
    (tmp_path / "other.json").write_text("{}")
    refused(cli("deploy", "other.json"), "formup/2")
    code, _, _ = cli(
        "run", picture, *CAR, "-n", 4, "--box", "55,35,125,95", "--plan-only", "--out", "o"
    )
    assert code == 0
    plan = json.loads((tmp_path / "o/plan.json").read_text())
    name = plan["plan_id"]
    formation = plan["world"]["plans"][name]["plan"]["formation"]
    formation["positions"][0][0] += 5
    (tmp_path / "altered.json").write_text(json.dumps(plan))
    refused(cli("deploy", "altered.json"), "altered.json", "altered")
    Image.new("RGB", (200, 140)).save(picture)
    refused(cli("deploy", "o/plan.json", "--image", picture), "changed")
    shutil.rmtree(tmp_path / "o/pictures")
    refused(cli("deploy", "o/plan.json"), "changed")
    picture.unlink()
    refused(cli("deploy", "o/plan.json"), "not beside it", "give it as the image")


def test_tools_by_hand_say_what_is_wrong(cli: Cli, picture: Path) -> None:
    refused(cli("tools", "call", "fly", "--image", picture), "'fly'", "propose_formation")
    refused(cli("tools", "call", "look"), "--image")
    refused(cli("tools", "call", "look", "--image", picture, "--args", "{"), "not JSON")
    refused(cli("tools", "call", "look", "--image", picture, "--args", "[1]"), "JSON object")
    refused(
        cli("tools", "call", "check_point", "--image", picture, "--args", '{"target": 3}'),
        "target:",
        "points: is missing",
    )


def test_eval_says_what_is_wrong(cli: Cli, tmp_path: Path) -> None:
    refused(cli("eval", "run", "photos", "--mode", "psychic"), "'psychic'", "outline")
    refused(cli("eval", "run", tmp_path), "annotations.json")
    refused(cli("eval", "run", "photos", "--trials", 0), "--trials '0'")
    refused(cli("eval", "run", "scenes", "--seeds", "9-3"), "'9-3'", "0-199")
    refused(cli("eval", "run", "smoke", "--seeds", "0-3"), "not made of one range of seeds")
    replay = ("--method", "agent", "--model", f"replay:{tmp_path}")
    refused(cli("eval", "run", "photos", *replay), "No task is left to run")
    (tmp_path / "annotations.json").write_text("[{}]")
    refused(cli("eval", "run", tmp_path), "required")


@pytest.mark.parametrize("scale", ["0", "-1", "nan", "inf", "1e9", "5 cm", ""])
def test_no_scale_of_a_picture(cli: Cli, picture: Path, scale: str) -> None:
    refused(
        cli("run", picture, *CAR, "--metres-per-pixel", scale),
        f"--metres-per-pixel {scale!r}",
        "0.000001 to 1000, such as 0.05",
    )
    tool = ("tools", "call", "look", "--image", picture)
    refused(cli(*tool, "--metres-per-pixel", scale), "--metres-per-pixel")


@pytest.mark.parametrize("option", ["--clearance", "--robot-radius"])
def test_metric_options_take_a_scale(cli: Cli, picture: Path, option: str) -> None:
    refused(cli("run", picture, *CAR, option, "1.5m"), f"{option} '1.5m'", "--metres-per-pixel")
    refused(cli("run", picture, *CAR, option, "1.5 miles"), "1.5 miles", "1.5m or 40cm")


@pytest.mark.parametrize(
    "command", [("serve",), ("mcp",), ("mcp", "--http"), ("chat", "scene.png")]
)
@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--detector", "owl", "Unknown detector 'owl'"),
        ("--segmenter", "scissors", "Unknown segmenter 'scissors'"),
        ("--detector", "vlm", "sees no picture; choose a model"),
        ("--threshold", "2", "--threshold '2' cannot be used; give a number from 0 to 1"),
    ],
)
def test_who_serves_or_chats_is_told_at_the_start(
    cli: Cli, picture: Path, command: tuple[str, ...], option: str, value: str, said: str
) -> None:
    code, out, err = cli(*command, option, value, "--store", picture.parent / "store")
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
