"""A question with candidates: its picture and JSON, --target, and answers at a real terminal."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply, Result, User
from formup.agent.wrappers.doubles import ScriptedModel
from formup.apps.arguments import pointed
from formup.apps.run_files import Folder, write_files
from formup.tools.context import Settings
from formup.tools.draw import draw_look
from formup.tools.errors import InputError
from formup.tools.perception.image import load_picture
from formup.tools.world import World
from PIL import Image, ImageChops

SMARTIES = Path(__file__).parents[2] / "evals/photos/images/smarties.png"
TABLE = SMARTIES.with_name("table_stuff.jpg")
PLAN = Settings(may_deploy=False)
BLUE = (SMARTIES, "Ring the blue ball", "-n", "4")
PROMPT = "your answer"
person = pytest.mark.skipif(sys.platform == "win32", reason="POSIX terminals")


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "formup", "run", *map(str, arguments), "--out", "out"]


def formup(*arguments: object, cwd: Path, said: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments), cwd=cwd, input=said, capture_output=True, text=True, check=False
    )


def at_terminal(
    *arguments: object, cwd: Path, answers: Sequence[str], prompt: str = PROMPT
) -> tuple[int, str]:
    """Exit code and all that was shown to a person who types these at the prompts."""
    import pty

    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        command(*arguments),
        cwd=cwd,
        env=os.environ | {"TERM": "dumb", "COLUMNS": "120"},
        preexec_fn=lambda: os.login_tty(theirs),
    )
    os.close(theirs)
    shown, left = b"", list(answers)
    while more := _read(ours):
        shown += more
        if left and shown.count(prompt.encode()) > len(answers) - len(left):
            os.write(ours, os.fsencode(left.pop(0)))
    os.close(ours)
    code = process.wait(timeout=60)
    assert not left, os.fsdecode(shown)
    return code, os.fsdecode(shown)


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:  # Linux: nobody holds the other end any more
        return b""


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The report of a question about the blue ones of several."""
    folder = tmp_path_factory.mktemp("asked")
    done = formup(*BLUE, "--json", cwd=folder)
    assert done.returncode == 3, done.stderr
    return json.loads(done.stdout) | {"folder": folder / "out"}


def test_a_question_offers_candidates_and_their_picture(asked: dict[str, Any]) -> None:
    assert asked["status"] == "question"
    assert len(asked["candidates"]) >= 2
    for choice in asked["candidates"]:
        assert list(choice) == ["id", "label", "box", "colour", "shape", "area_px"]
        assert (choice["id"][0], choice["colour"]) == ("c", "blue")
        x0, y0, x1, y1 = choice["box"]
        assert 0 < choice["area_px"] < (x1 - x0) * (y1 - y0)
    assert asked["files"]["picture"] == "question.png"
    names = sorted(p.name for p in asked["folder"].iterdir())
    assert names == ["pictures", "question.png", "trace.jsonl"]


def test_the_picture_shows_what_is_asked_about_and_nothing_else(asked: dict[str, Any]) -> None:
    with Image.open(asked["folder"] / "question.png") as image:
        shown = image.convert("RGB")
    picture = load_picture(SMARTIES)
    bare = draw_look(picture, World.of(picture))
    marked = ImageChops.difference(shown, bare)
    scale, left, top = 1200 / 413, 52, 30
    for choice in asked["candidates"]:
        x0, y0, x1, y1 = (v * scale for v in choice["box"])
        around = (x0 + left - 40, y0 + top - 40, x1 + left + 40, y1 + top + 40)
        part = tuple(round(v) for v in around)
        assert marked.crop(part).getbbox() is not None
        marked.paste(0, part)
    assert marked.getbbox() is None


@pytest.mark.parametrize("form", ["{}", "c{}", "C{}"])
def test_target_says_which_one(asked: dict[str, Any], tmp_path: Path, form: str) -> None:
    last = asked["candidates"][-1]
    number = last["id"].removeprefix("c")
    done = formup(*BLUE, "--target", form.format(number), "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    data = json.loads(done.stdout)
    assert data["candidates"] is None
    assert data["targets"][0]["box"] == pytest.approx(last["box"], abs=4)
    assert not (tmp_path / "out/question.png").exists()


def test_two_targets_to_stand_between(asked: dict[str, Any], tmp_path: Path) -> None:
    one, other = asked["candidates"][0], asked["candidates"][-1]
    more = ("-n", 3, "--target", one["id"], "--target", other["id"], "--json")
    done = formup(SMARTIES, "Stand between them", *more, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    data = json.loads(done.stdout)
    assert data["contract"]["groups"][0]["targets"] == ["t1", "t2"]
    for target, choice in zip(data["targets"], (one, other), strict=True):
        assert target["box"] == pytest.approx(choice["box"], abs=4)


def test_targets_are_numbered_on_after_what_was_pointed_at() -> None:
    found = pointed(["5,5"], ["1,1,9,9"], [], ["c3", "12"])
    assert [(p.id, p.candidate) for p in found[2:]] == [("t3", "c3"), ("t4", "c12")]


@person
def test_a_number_at_the_terminal_goes_on(asked: dict[str, Any], tmp_path: Path) -> None:
    last = asked["candidates"][-1]
    number = last["id"].removeprefix("c")
    code, shown = at_terminal(*BLUE, cwd=tmp_path, answers=[f"{number}\n"])
    assert code == 0, shown
    before, after = shown.split(PROMPT)
    assert asked["message"] in " ".join(before.split())
    for choice in asked["candidates"]:
        row = next(r for r in before.splitlines() if r.split()[:1] == [choice["id"][1:]])
        assert choice["label"] in row
        assert ", ".join(f"{v:.0f}" for v in choice["box"]) in row
    assert "out/ question.png" in before
    assert "deployed:" in after
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert names == {"plan.json", "plan.png", "deploy.gif", "trace.jsonl", "pictures"}
    plan = json.loads((tmp_path / "out/plan.json").read_text())
    assert plan["world"]["targets"][0]["box"] == pytest.approx(last["box"], abs=4)
    trace = [json.loads(line) for line in (tmp_path / "out/trace.jsonl").read_text().splitlines()]
    answers = [m["text"] for m in trace if m.get("name") == "ask_user"]
    assert answers == [number]


@person
def test_words_answer_too_and_one_question_follows_the_other(
    asked: dict[str, Any], tmp_path: Path
) -> None:
    chosen = asked["candidates"][0]["id"]
    answers = ["with 5 robots\n", f"{chosen}\n"]
    code, shown = at_terminal(SMARTIES, "Ring the blue ball", cwd=tmp_path, answers=answers)
    assert code == 0, shown
    assert "How many robots?" in shown
    assert "5 robots around t1" in shown


@person
@pytest.mark.parametrize("typed", ["\n", "   \n", "\x04"], ids=["enter", "blanks", "ctrl-d"])
def test_no_answer_leaves_the_question_open(tmp_path: Path, typed: str) -> None:
    code, shown = at_terminal(*BLUE, cwd=tmp_path, answers=[typed])
    assert code == 3, shown
    assert shown.count(PROMPT) == 1
    assert (tmp_path / "out/question.png").exists()


@person
def test_what_is_no_candidate_is_asked_again(asked: dict[str, Any], tmp_path: Path) -> None:
    answers = ["99\n", f"{asked['candidates'][0]['id']}\n"]
    code, shown = at_terminal(*BLUE, cwd=tmp_path, answers=answers)
    assert code == 0, shown


@person
def test_nobody_is_asked_for_ever(tmp_path: Path) -> None:
    answers = ["hm\n", "\udcff\n", "??\n", "no\n", "hm\n"]
    code, shown = at_terminal(*BLUE, cwd=tmp_path, answers=answers)
    assert code == 3, shown
    assert shown.count(PROMPT) == 5
    assert (tmp_path / "out/question.png").exists()


@person
def test_ctrl_c_at_the_prompt_ends_it(tmp_path: Path) -> None:
    code, shown = at_terminal(*BLUE, cwd=tmp_path, answers=["\x03"])
    assert code == 130, shown
    assert "Traceback" not in shown


@person
def test_nobody_is_asked_who_is_no_person(tmp_path: Path) -> None:
    piped = formup(*BLUE, cwd=tmp_path, said="3\n")
    assert piped.returncode == 3
    assert PROMPT not in piped.stdout
    code, shown = at_terminal(*BLUE, "--json", cwd=tmp_path, answers=[])
    assert code == 3
    assert PROMPT not in shown


def asking(*names: str) -> Reply:
    arguments = {"question": "Which?", "candidates": list(names)}
    return Reply(calls=(Call(id="q", name="ask_user", arguments=arguments),))


def test_an_answer_in_python_goes_on_where_it_paused() -> None:
    look = Reply(calls=(Call(id="l", name="locate_object", arguments={}),))
    script = [look, asking("c2", "c1", "c99", "t1"), Reply(text="done")]
    agent = Agent(ScriptedModel(script))
    paused = agent.run(load_picture(SMARTIES), "Ring one")
    assert [c["id"] for c in paused.report.candidates or ()] == ["c2", "c1"]
    shown: list[User | Reply | Result] = []
    done = agent.resume(paused, answer=" 2 ", show=shown.append)
    assert shown == [Result(call_id="q", name="ask_user", text="2"), Reply(text="done")]
    assert (done.report.message, done.report.candidates) == ("done", None)
    assert done.report.usage.requests == 3
    assert done.report.usage.seconds >= paused.report.usage.seconds > 0
    with pytest.raises(InputError, match="asked nothing"):
        agent.resume(done, answer="2")


@pytest.mark.parametrize(
    ("words", "answers", "left"),
    [
        ("the white disc and the coin", "5", [("white disc", 33), ("coin", 18)]),
        ("the coin and the lid", "52", [("chosen thing", 18), ("chosen thing", 19)]),
    ],
)
def test_of_two_things_an_answer_settles_the_one_asked_about(
    words: str, answers: str, left: list[tuple[str, int]]
) -> None:
    run = Agent().run(load_picture(TABLE), f"Line up 5 robots between {words}", settings=PLAN)
    for answer in answers:
        assert run.report.status == "question"
        assert "chooses none" not in run.report.message
        run = Agent().resume(run, answer=answer)
    assert run.report.status == "planned"
    assert [(t["label"], int(t["box"][0] / 10)) for t in run.report.targets] == left


def test_one_answer_is_not_used_for_two_things() -> None:
    words = "Surround the silver car with 6 robots, but stay clear of the red one"
    run = Agent().run(load_picture(SMARTIES.with_name("cars_two.jpg")), words, settings=PLAN)
    asked: list[str] = []
    for answer in "121":
        asked.append(run.report.message.partition(" is ")[2].partition("?")[0])
        run = Agent().resume(run, answer=answer)
    assert asked == ['"the silver car"', '"the silver car"', '"the red one"']
    assert run.report.status == "planned"
    (target, free) = run.report.targets
    assert (target["label"], int(target["box"][0] / 100)) == ("silver car", 0)
    assert (free["label"], int(free["box"][0] / 100)) == ("red one", 3)
    assert run.report.contract is not None
    assert list(run.report.contract.keep_out) == [free["id"]]


@pytest.mark.parametrize(
    ("text", "word"), [("", "empty"), (" \n", "empty"), ("x" * 4001, "4,000"), ("\ud800", "UTF-8")]
)
def test_answers_that_are_none(text: str, word: str) -> None:
    agent = Agent(ScriptedModel([asking("c1")]))
    paused = agent.run(load_picture(SMARTIES), "Ring one")
    with pytest.raises(InputError, match=word):
        agent.resume(paused, answer=text)


def test_targets_that_are_asked_about_are_shown_without_the_others(tmp_path: Path) -> None:
    boxes = [(180, 185, 232, 238), (240, 90, 297, 146)]
    found = tuple(
        Call(id=f"s{i}", name="segment", arguments={"id": f"t{i}", "box": list(box)})
        for i, box in enumerate(boxes, start=1)
    )
    agent = Agent(ScriptedModel([Reply(calls=found), asking("t2")]))
    picture = load_picture(SMARTIES)
    run = agent.run(picture, "Ring one")
    other = run.world.target("t2")
    box = pytest.approx(other.box, abs=0.1)
    assert run.report.candidates == ({"id": "t2", "label": other.label, "box": box},)
    files = write_files(Folder(tmp_path / "out"), run)
    assert files["picture"] == "question.png"
    with Image.open(tmp_path / "out/question.png") as image:
        wanted = draw_look(picture, World.of(picture, targets=(other,)))
        assert ImageChops.difference(image.convert("RGB"), wanted).getbbox() is None


@person
@pytest.mark.parametrize(
    ("said", "word", "code"),
    [("y\n", "deployed:", 0), ("no, it rains\n", "said no: no, it rains", 0)],
)
def test_leave_to_move_is_asked_for_at_a_terminal(
    said: str, word: str, code: int, tmp_path: Path
) -> None:
    coins = SMARTIES.with_name("us_coins.jpg")
    words = (coins, "Cage the largest coin", "-n", "6", "--policy", "deploy=ask")
    ended, shown = at_terminal(
        *words, cwd=tmp_path, answers=[said], prompt="yes, or no and the reason"
    )
    assert word in " ".join(shown.split())
    assert ended == code
