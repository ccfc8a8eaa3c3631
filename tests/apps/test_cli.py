"""The main job from the command line: files, JSON, exit codes, deploy, tools, Ctrl-C."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from PIL import Image

PHOTOS = Path(__file__).parents[2] / "evals/photos/images"
CAR_BOX = ("--box", "322,118,478,405")
KEYS = [
    "status",
    "message",
    "instruction",
    "image",
    "targets",
    "candidates",
    "options",
    "contract",
    "plan_id",
    "parent",
    "robots",
    "positions",
    "headings_deg",
    "verdict",
    "motion",
    "partial",
    "arrival",
    "metric",
    "model",
    "prompt",
    "prompts",
    "usage",
    "files",
]


def formup(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "formup", *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


def report(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    return json.loads(done.stdout)


def test_main_job_prints_one_json_object_and_writes_its_files(tmp_path: Path) -> None:
    done = formup(
        "run",
        PHOTOS / "cars_two.jpg",
        "Surround the car at the corners",
        "-n",
        4,
        *CAR_BOX,
        "--json",
        "--out",
        "out",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    data = report(done)
    assert list(data) == KEYS
    assert data["status"] == "deployed"
    assert data["contract"]["groups"][0]["relation"] == "corners"
    assert data["verdict"]["certified"] is True
    assert data["verdict"]["findings"] == []
    assert data["arrival"]["arrived"] is True
    assert len(data["positions"]) == len(data["arrival"]["observed"]) == 4
    assert max(data["arrival"]["residual_px"]) < 1
    assert data["model"] == "offline"
    assert data["prompt"] is None
    assert data["usage"]["requests"] == 3
    for name in data["files"].values():
        assert (tmp_path / "out" / name).stat().st_size > 0
    with Image.open(tmp_path / "out" / "deploy.gif") as animation:
        assert getattr(animation, "n_frames") > 10  # noqa: B009
    lines = [json.loads(t) for t in (tmp_path / "out/trace.jsonl").read_text().splitlines()]
    assert (lines[0]["type"], lines[-1]["type"]) == ("session", "end")
    roles = [line["role"] for line in lines if line["type"] == "message"]
    assert roles == ["user", "assistant", "tool", "assistant", "tool", "assistant"]


def test_plan_only_moves_nothing_and_deploy_moves_exactly_that_plan(tmp_path: Path) -> None:
    planned = formup(
        "run",
        PHOTOS / "us_coins.jpg",
        "Cage the coin",
        "-n",
        10,
        "--point",
        "245,95",
        "--plan-only",
        "--json",
        "--out",
        "out",
        cwd=tmp_path,
    )
    assert planned.returncode == 0, planned.stderr
    data = report(planned)
    assert (data["status"], data["arrival"], data["files"]["animation"]) == ("planned", None, None)
    moved = formup("deploy", "out/plan.json", "--json", cwd=tmp_path)
    assert moved.returncode == 0, moved.stderr
    arrived = report(moved)
    assert list(arrived) == KEYS
    assert arrived["status"] == "deployed"
    assert arrived["plan_id"] == data["plan_id"]
    assert arrived["positions"] == data["positions"]
    assert (tmp_path / "out/deploy.gif").exists()


def test_more_robots_than_there_are_corners_leave_a_partial_plan_for_a_person(
    tmp_path: Path,
) -> None:
    task = (PHOTOS / "cars_two.jpg", "Surround the car at the corners", "-n", 6, *CAR_BOX)
    done = formup("run", *task, "--json", "--out", "out", cwd=tmp_path)
    data = report(done)
    assert (done.returncode, data["status"]) == (3, "impossible")
    assert "only 4 robots fit" in data["message"]
    assert data["plan_id"] in data["message"]
    assert "report_impossible" not in data["message"]
    assert (data["partial"]["asked"], data["partial"]["placed"]) == (6, 4)
    assert len(data["positions"]) == 4
    assert data["verdict"]["certified"] is True
    assert data["arrival"] is None
    assert (tmp_path / "out/plan.png").exists()
    moved = formup("deploy", "out/plan.json", "--json", cwd=tmp_path)
    assert moved.returncode == 0, moved.stderr
    assert "a partial plan: 4 of the 6 robots" in moved.stderr
    assert report(moved)["partial"] == data["partial"]
    assert "partial" in report(moved)["message"]


def test_terminal_output_names_what_a_person_needs(tmp_path: Path) -> None:
    done = formup(
        "run",
        PHOTOS / "us_coins.jpg",
        "Make a ring of 10 robots around the coin",
        "--point",
        "245,95",
        "--out",
        "out",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    for word in ("found", "t1", "contract", "certified", "requested", "deployed:", "plan.png"):
        assert word in done.stdout


@pytest.mark.parametrize(
    ("instruction", "more", "word"),
    [
        ("Do something nice", CAR_BOX, "arrangement"),
        ("Surround the car", CAR_BOX, "How many"),
        ("Surround the car with many robots", CAR_BOX, "many robots"),
        ("Surround the car", ("-n", 4), "Which one is"),
        ("Stand between the cars", ("-n", 4, *CAR_BOX), "two things"),
        ("Ring the car and fill it", ("-n", 4, *CAR_BOX), "or"),
    ],
)
def test_what_the_words_leave_open_is_asked(
    tmp_path: Path, instruction: str, more: tuple[object, ...], word: str
) -> None:
    done = formup("run", PHOTOS / "cars_two.jpg", instruction, *more, "--json", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    data = report(done)
    assert data["status"] == "question"
    assert word in data["message"]
    assert data["positions"] is None


def test_more_robots_than_fit_says_how_many_do(tmp_path: Path) -> None:
    done = formup(
        "run",
        PHOTOS / "us_coins.jpg",
        "Fill the coin with robots",
        "-n",
        400,
        "--point",
        "245,95",
        "--robot-radius",
        6,
        "--json",
        cwd=tmp_path,
    )
    assert done.returncode == 3, done.stderr
    data = report(done)
    assert data["status"] == "impossible"
    assert "400 robots were asked for but only" in data["message"]


def test_low_confidence_is_the_papers_sentence_and_nothing_moves(tmp_path: Path) -> None:
    done = formup(
        "run",
        PHOTOS / "us_coins.jpg",
        "Cage the coin",
        "-n",
        9,
        "--point",
        "245,95",
        "--threshold",
        1,
        "--json",
        cwd=tmp_path,
    )
    assert done.returncode == 3
    data = report(done)
    assert data["message"].startswith("Insufficient segmentation accuracy.")
    assert data["files"]["picture"] == "found.png"


def test_more_than_a_thousand_robots_are_planned_and_it_says_so(tmp_path: Path) -> None:
    done = formup(
        "run",
        PHOTOS / "ucm_tenniscourt30.jpg",
        "Fill it",
        "-n",
        1001,
        "--box",
        "229,197,559,565",
        "--json",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    data = report(done)
    assert data["status"] == "planned"
    assert "up to 1000" in data["message"]
    assert len(data["positions"]) == 1001


def test_starts_seed_radius_and_clearance_are_held_to(tmp_path: Path) -> None:
    (tmp_path / "starts.json").write_text(json.dumps([[20 + 30 * i, 420] for i in range(6)]))
    done = formup(
        "run",
        PHOTOS / "us_coins.jpg",
        "Encircle it",
        "-n",
        6,
        "--point",
        "245,95",
        "--starts",
        "starts.json",
        "--robot-radius",
        5,
        "--clearance",
        12,
        "--seed",
        3,
        "--json",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    data = report(done)
    assert data["contract"]["robot_radius"] == 5
    assert data["contract"]["groups"][0]["clearance"] == [11, 13]
    assert 11 <= data["verdict"]["measures"]["min_clearance_px"] <= 13


def test_a_scale_gives_lengths_in_metres_and_goes_with_the_plan(tmp_path: Path) -> None:
    command = ("run", PHOTOS / "cars_two.jpg", "Surround the car", "-n", 6, *CAR_BOX, "--json")
    scaled = ("--metres-per-pixel", 0.02, "--clearance", "0.5m", "--robot-radius", "10 cm")
    done = formup(*command, *scaled, "--plan-only", "--out", "out", cwd=tmp_path)
    planned = report(done)
    assert planned["status"] == "planned", done.stderr
    assert planned["contract"]["robot_radius"] == 5
    least, most = planned["contract"]["groups"][0]["clearance"]
    assert least < 25 < most
    assert planned["metric"]["metres_per_pixel"] == 0.02
    again = report(formup("deploy", "out/plan.json", "--json", cwd=tmp_path))
    assert again["status"] == "deployed"
    assert again["metric"]["positions"] == planned["metric"]["positions"]
    assert len(again["metric"]["observed"]) == 6
    shown = formup("deploy", "out/plan.json", cwd=tmp_path).stdout
    assert " px) away" in " ".join(shown.split())


def test_the_schema_of_a_contract_is_what_the_tool_takes(tmp_path: Path) -> None:
    schema = json.loads(formup("tools", "schema", "contract", cwd=tmp_path).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    group = {"relation": "around", "targets": ["t1"], "robots": 6}
    jsonschema.validate({"groups": [group]}, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"groups": [group | {"robots": 0}]}, schema)
    listed = json.loads(formup("tools", "schema", "propose_formation", cwd=tmp_path).stdout)
    given = listed["properties"]["contract"]
    assert given["properties"]["groups"]["minItems"] == schema["properties"]["groups"]["minItems"]
    unknown = formup("tools", "schema", "nothing", cwd=tmp_path)
    assert (unknown.returncode, "contract, " in unknown.stderr) == (2, True)


def test_tools_are_listed_with_valid_schemas(tmp_path: Path) -> None:
    listed = json.loads(formup("tools", "list", "--json", cwd=tmp_path).stdout)
    assert {t["name"] for t in listed} >= {"look", "segment", "propose_formation", "deploy"}
    for tool in listed:
        jsonschema.Draft202012Validator.check_schema(tool["parameters"])
        assert "prefixItems" not in json.dumps(tool["parameters"])
    plain = formup("tools", "list", cwd=tmp_path).stdout
    assert len(plain.splitlines()) == len(listed)


def test_tools_called_by_hand_share_a_state_file(tmp_path: Path) -> None:
    def call(name: str, arguments: dict[str, Any], *more: object) -> dict[str, Any]:
        done = formup(
            "tools",
            "call",
            name,
            "--args",
            json.dumps(arguments),
            "--state",
            "s.json",
            *more,
            cwd=tmp_path,
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    found = call("segment", {"box": [322, 118, 478, 405]}, "--image", PHOTOS / "cars_two.jpg")
    assert found["id"] == "t1"
    shape = call("describe_shape", {"target": "t1", "descriptor": "edges+vertices"})
    assert shape["vertices"]
    sample = call("sample_along_edges", {"target": "t1", "n": 8})
    contract = {"groups": [{"relation": "around", "targets": ["t1"], "robots": 8}]}
    plan = call("propose_formation", {"contract": contract, "samples": [sample["sample"]]})
    assert plan["certified"], plan
    looked = call("look", {"plan_id": plan["plan_id"]})
    with Image.open(tmp_path / looked["pictures"][0]) as image:
        assert min(image.size) > 400
    assert call("deploy", {"plan_id": plan["plan_id"]})["arrived"]


def test_help_and_no_arguments_explain_themselves(tmp_path: Path) -> None:
    for arguments in ((), ("run", "--help"), ("tools", "--help"), ("eval", "--help")):
        done = formup(*arguments, cwd=tmp_path)
        assert "Usage" in done.stdout + done.stderr
        assert "Traceback" not in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_stops_at_once_and_leaves_no_half_written_file(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    Image.fromarray(random.integers(0, 255, (900, 1200, 3), dtype=np.uint8)).save(
        tmp_path / "noise.png"
    )
    command = [
        sys.executable,
        "-m",
        "formup",
        "run",
        "noise.png",
        "Fill it",
        "-n",
        "1000",
        "--box",
        "100,100,1100,800",
        "--threshold",
        "0",
        "--out",
        "out",
    ]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "out").exists():
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted" in err
    assert "Traceback" not in err
    left = sorted((tmp_path / "out").iterdir()) if (tmp_path / "out").exists() else []
    assert [p.name for p in left] in ([], ["trace.jsonl"], ["pictures", "trace.jsonl"])
    assert not [p for p in (tmp_path / "out").glob("pictures/*") if p.name.startswith(".")]
    traces = [p for p in left if p.name == "trace.jsonl"]
    assert all(json.loads(line) for p in traces for line in p.read_text().splitlines())


def test_what_is_kept_out_of_is_in_the_contract_and_nobody_stands_there(tmp_path: Path) -> None:
    picture = np.full((200, 300, 3), 150, np.uint8)
    picture[70:130, 120:180] = (200, 40, 40)
    Image.fromarray(picture).save(tmp_path / "scene.png")
    words = ("Surround the red square", "-n", 6, "--box", "116,66,184,134", "--plan-only", "--json")
    bare = report(formup("run", "scene.png", *words, cwd=tmp_path))
    x, y = bare["positions"][0]
    kept = f"{x - 4},{y - 4},{x + 4},{y + 4}"
    done = report(formup("run", "scene.png", *words, "--keep-out", kept, cwd=tmp_path))
    assert (done["status"], done["contract"]["keep_out"]) == ("planned", ["k1"])
    places = np.array(done["positions"])
    assert not (np.abs(places - (x, y)) <= 4).all(axis=1).any()
