"""A workspace written to JSON and read back is the same, or is refused in one sentence."""

import asyncio
import json
import os
from pathlib import Path

import pytest
from formup.evals.tasks.suites import load_suite
from formup.tools.builtin import TOOLS
from formup.tools.errors import InputError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import make_plan
from formup.tools.perception.image import load_picture
from formup.tools.scene import Scene, Target
from formup.tools.store import read_stored, restore, store, write_whole
from formup.tools.world import Settings, Workspace

PHOTO = Path(__file__).parents[2] / "evals/photos/images/scissors_blue.jpg"


@pytest.fixture(scope="module")
def work() -> Workspace:
    outline = (
        next(t for t in load_suite("photos").tasks if t.id == "scissors_blue_t1").things[0].outline
    )
    assert len(outline.polygon.interiors) == 2
    target = Target("t1", "scissors", outline.bounds, 1.0, outline, "outline")
    workspace = Workspace(Scene(load_picture(PHOTO), (target,)))
    group = Group(relation="around", targets=("t1",), robots=9)
    contract = Contract(groups=(group,))
    scene = workspace.scene
    plan = make_plan(contract, scene.site(contract), scene.version)
    workspace.plans[plan.id] = plan
    workspace.keep_sample(plan.formation.points)
    return workspace


def written(work: Workspace, path: Path) -> Path:
    path.write_text(store(work).model_dump_json())
    return path


def test_round_trip_keeps_everything(work: Workspace, tmp_path: Path) -> None:
    back = restore(read_stored(written(work, tmp_path / "s.json")), None, Settings())
    assert back.scene.version == work.scene.version
    assert back.plans == work.plans
    assert (back.samples["s1"] == work.samples["s1"]).all()
    (plan_id,) = back.plans
    deploy = next(t for t in TOOLS if t.name == "deploy")
    assert asyncio.run(deploy.call(back, {"plan_id": plan_id})).data["arrived"]


def test_an_altered_plan_is_refused(work: Workspace, tmp_path: Path) -> None:
    path = written(work, tmp_path / "s.json")
    data = json.loads(path.read_text())
    (plan,) = data["plans"].values()
    plan["formation"]["positions"][3][1] += 0.5
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match="altered"):
        read_stored(path)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("targets", 0, "outline", 0, 0), 3.0),
        (("targets", 0, "label"), "another"),
        (("instruction",), "something else"),
        (("image", "width"), 9),
        (("samples", "s1", 0, 0), 3.0),
        (("digest",), "0"),
    ],
)
def test_any_alteration_shows(
    work: Workspace, tmp_path: Path, path: tuple[str | int, ...], value: object
) -> None:
    file = written(work, tmp_path / "s.json")
    data = json.loads(file.read_text())
    part = data
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match="altered"):
        read_stored(file)


def test_hostile_files_are_refused_in_one_sentence(work: Workspace, tmp_path: Path) -> None:
    file = tmp_path / "s.json"
    file.write_text("[" * 100_000)
    with pytest.raises(InputError, match="not JSON"):
        read_stored(file)
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        read_stored(file)
    text = written(work, file).read_text()
    file.write_text(text.replace('"instruction":null', '"instruction":"\\ud800"'))
    with pytest.raises(InputError, match=r"damaged|altered"):
        read_stored(file)
    with pytest.raises(InputError, match="no file"):
        read_stored(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [("", "not JSON"), ("[]", "formup/1"), ('{"format": "formup/1"}', "image: is missing")],
)
def test_other_files_are_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "s.json").write_text(text)
    with pytest.raises(InputError, match=words):
        read_stored(tmp_path / "s.json")


def test_files_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "x"
    write_whole(path, b"one")
    write_whole(path, b"two")
    assert path.read_bytes() == b"two"
    assert [p.name for p in tmp_path.iterdir()] == ["x"]
    with pytest.raises(InputError, match="cannot be written"):
        write_whole(tmp_path / "nowhere" / "x", b"")


@pytest.mark.skipif(os.name != "posix", reason="no such devices elsewhere")
def test_devices_and_links_stay_what_they_are(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_whole(tmp_path / "pipe", b"one")
    assert os.read(reader, 9) == b"one"
    os.close(reader)
    assert (tmp_path / "pipe").is_fifo()
    (tmp_path / "link").symlink_to(tmp_path / "file")
    (tmp_path / "file").write_bytes(b"before")
    write_whole(tmp_path / "link", b"after")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_bytes() == b"after"


@pytest.mark.skipif(os.name != "posix", reason="no umask elsewhere")
def test_others_may_read_what_the_umask_lets_them(tmp_path: Path) -> None:
    for mask in (0o022, 0o077):
        before = os.umask(mask)
        try:
            write_whole(tmp_path / "x", b"one")
        finally:
            os.umask(before)
        assert (tmp_path / "x").stat().st_mode & 0o777 == 0o666 & ~mask
