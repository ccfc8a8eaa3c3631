"""A world written to a file and read back is the same, or is refused in one sentence."""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from shutil import copyfile
from typing import TYPE_CHECKING, Any, cast

import pytest
from formup.evals.tasks.suites import load_suite
from formup.tools.errors import ImageError, InputError, StorageError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import make_plan
from formup.tools.perception.image import load_picture
from formup.tools.store import StoredWorld, picture_of, plan_file, read_world, write_whole
from formup.tools.world import PlanNode, ShownCandidate, Target, World

if TYPE_CHECKING:
    from .conftest import ToolCalls

PHOTO = Path(__file__).parents[2] / "evals/photos/images/scissors_blue.jpg"
Begin = Callable[..., "ToolCalls"]


@pytest.fixture(scope="module")
def world() -> World:
    outline = (
        next(
            t
            for t in load_suite("photos").tasks
            if isinstance(t.picture, Path) and t.picture.samefile(PHOTO)
        )
        .things[0]
        .outline
    )
    assert len(outline.polygon.interiors) == 2
    target = Target(
        id="t1",
        label="scissors",
        box=outline.bounds,
        confidence=1.0,
        outline=outline,
        prompt="outline",
    )
    made = World.of(load_picture(PHOTO), targets=(target,))
    for robots in (5, 9):
        contract = Contract(groups=(Group(relation="around", targets=("t1",), robots=robots),))
        plan = make_plan(contract, made.site(contract), made.version_of(contract))
        made = made.with_plan(PlanNode(plan=plan, unseen=("t1",)))
    made, _ = made.with_sample(plan.formation.positions)
    return made.having(shown=(ShownCandidate(id="c1", label="blue", box=(1, 2, 30, 40)),))


def written(path: Path, world: World, **more: Any) -> Path:
    given = {"instruction": "Ring it", "picture": str(PHOTO)} | more
    path.write_bytes(StoredWorld(world=world, **given).to_bytes())
    return path


def test_round_trip_keeps_everything(world: World, tool_calls: Begin, tmp_path: Path) -> None:
    path = written(tmp_path / "s.json", world)
    stored = read_world(path)
    assert stored.world == world
    assert not any(stored.world.is_void(node.plan) for node in world.plans.values())
    assert list(stored.world.plans) == list(world.plans)
    assert (stored.instruction, stored.plan_id) == ("Ring it", None)
    assert written(tmp_path / "again.json", stored.world).read_bytes() == path.read_bytes()
    back = tool_calls(picture_of(stored, path), world=stored.world)
    for plan_id in world.plans:
        assert back.call("deploy", plan_id=plan_id).data["arrived"]


def test_a_plan_file_holds_one_plan_and_what_it_depends_on(
    world: World, tool_calls: Begin, tmp_path: Path
) -> None:
    first, last = world.plans
    picture = load_picture(PHOTO)
    work = tool_calls(picture, world=world)
    for plan_id in (last, first):
        work.call("deploy", plan_id=plan_id)
    path = tmp_path / "plan.json"
    path.write_bytes(plan_file(work.world, first, "Ring it", picture))
    stored = read_world(path)
    assert (stored.plan_id, stored.instruction, stored.picture) == (first, "Ring it", str(PHOTO))
    kept = stored.world
    assert kept.plans == {first: world.plans[first]}
    assert kept.plan() == world.plans[first]
    assert kept.arrivals == {first: work.world.arrivals[first]}
    assert (kept.targets, kept.robots) == (world.targets, work.world.robots)
    assert (kept.samples, kept.shown) == ({}, ())
    assert not kept.is_void(world.plans[first].plan)
    again = tool_calls(picture_of(stored, path), world=kept)
    assert again.call("deploy", plan_id=first).data["already_there"]


def test_an_altered_plan_is_refused_though_the_digest_fits(world: World, tmp_path: Path) -> None:
    name, node = next(iter(world.plans.items()))
    (x, y), *others = node.plan.formation.positions
    formation = node.plan.formation.model_copy(update={"positions": ((x, y + 0.5), *others)})
    plan = node.plan.model_copy(update={"formation": formation})
    changed = world.having(plans={name: node.model_copy(update={"plan": plan})})
    with pytest.raises(StorageError, match="altered"):
        read_world(written(tmp_path / "s.json", changed))


def test_two_targets_of_one_id_are_refused(world: World, tmp_path: Path) -> None:
    (target,) = world.targets
    other = target.model_copy(update={"label": "another"})
    with pytest.raises(StorageError, match="altered"):
        read_world(written(tmp_path / "s.json", world.having(targets=(target, other))))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("world", "targets", 0, "outline", "outline", 0, 0), 3.0),
        (("world", "targets", 0, "label"), "another"),
        (("world", "picture", "width"), 9),
        (("world", "samples", "s1", 0, 0), 3.0),
        (("world", "current"), "p-0"),
        (("world", "metres_per_pixel"), 0.5),
        (("instruction",), "something else"),
        (("picture",), "elsewhere.png"),
        (("plan_id",), "p-0"),
        (("digest",), "0"),
    ],
)
def test_any_alteration_shows(
    world: World, tmp_path: Path, path: tuple[str | int, ...], value: object
) -> None:
    file = written(tmp_path / "s.json", world)
    data = json.loads(file.read_text())
    part = data
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    file.write_text(json.dumps(data))
    with pytest.raises(StorageError, match="altered"):
        read_world(file)


def test_unknown_and_repeated_names_are_refused(world: World, tmp_path: Path) -> None:
    file = written(tmp_path / "s.json", world)
    text = file.read_text()
    paths = [path for path in objects(json.loads(text)) if path[-1:] not in OPEN]
    assert len(paths) > 10
    for path in paths:
        data = json.loads(text)
        part = data
        for key in path:
            part = part[key]
        part["king"] = 1
        file.write_text(json.dumps(data))
        with pytest.raises(StorageError, match=r"damaged: .*king"):
            read_world(file)
    for name in ("digest", "outline", "certified"):
        file.write_text(text.replace(f'"{name}":', f'"{name}": 1, "{name}":', 1))
        with pytest.raises(InputError, match=f"s\\.json has '{name}' twice in one object"):
            read_world(file)


OPEN = [("parts",), ("measures",)]
"""Mappings whose names are anybody's."""


def objects(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The places of all objects in a JSON value."""
    if isinstance(value, dict):
        yield path
        for name, part in cast(dict[str, Any], value).items():
            yield from objects(part, (*path, name))
    elif isinstance(value, list):
        for number, part in enumerate(cast(list[Any], value)):
            yield from objects(part, (*path, number))


def test_positions_altered_in_the_file_are_refused(world: World, tmp_path: Path) -> None:
    path = written(tmp_path / "s.json", world)
    data = json.loads(path.read_text())
    node, *_ = data["world"]["plans"].values()
    node["plan"]["formation"]["positions"][3][1] += 0.5
    path.write_text(json.dumps(data))
    with pytest.raises(StorageError, match="altered"):
        read_world(path)


def test_hostile_files_are_refused_in_one_sentence(world: World, tmp_path: Path) -> None:
    file = tmp_path / "s.json"
    file.write_text("[" * 100_000)
    with pytest.raises(StorageError, match="not JSON"):
        read_world(file)
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(StorageError, match="UTF-8"):
        read_world(file)
    text = written(file, world).read_text()
    assert '"instruction": "Ring it"' in text
    for hostile in ("\\ud800", "\\udc00\\ud800", "x\\u0000"):
        file.write_text(text.replace("Ring it", hostile))
        with pytest.raises(StorageError, match=r"damaged|altered"):
            read_world(file)
    with pytest.raises(StorageError, match="no file"):
        read_world(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not JSON"),
        ("[]", "formup/2"),
        ('{"format": "formup/1"}', "formup/2"),
        ('{"format": "formup/2"}', "world: is missing"),
        ('{"format": "formup/2", "world": {"picture": 3}}', "damaged: world.picture"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "s.json").write_text(text)
    with pytest.raises(StorageError, match=words):
        read_world(tmp_path / "s.json")


@pytest.mark.parametrize(
    ("part", "value", "words"),
    [
        ("targets", [{"outline": [3]}], "no outline"),
        ("targets", [{"outline": {"outline": [[0, 0], [1, 1]]}}], "no outline"),
        ("targets", [{"outline": {"outline": 3}}], "no outline"),
        ("targets", [{"outline": {"outline": [["a", "b"]]}}], "no outline"),
        ("targets", [{"outline": {"outline": [[0, 0], [9, 9], [0, 9], [9, 0]]}}], "no outline"),
        ("targets", [{"outline": {"outline": [[0, 0], [9, 9], [0, 1e999]]}}], "no outline"),
        ("keep_out", [{"outline": {"rings": 3}}], "no outline"),
        ("robots", [{"id": "1", "x": "left", "y": 0}], "robots.0.x"),
        ("metres_per_pixel", -2, "-2 metres per pixel"),
        ("plans", {"p-1": {"plan": None}}, "plans.p-1.plan"),
        ("colour", "red", "colour"),
    ],
)
def test_a_damaged_part_is_named(tmp_path: Path, part: str, value: object, words: str) -> None:
    facts = {"sha256": "a", "width": 9, "height": 9}
    data = {"format": "formup/2", "world": {"picture": facts, part: value}}
    (tmp_path / "s.json").write_text(json.dumps(data))
    with pytest.raises(StorageError, match=rf"s\.json is damaged: .*{words}"):
        read_world(tmp_path / "s.json")


def test_the_picture_is_found_beside_the_file_or_where_it_lay_or_is_named(
    world: World, tmp_path: Path
) -> None:
    photo = tmp_path / "photo.jpg"
    copyfile(PHOTO, photo)
    (tmp_path / "run").mkdir()
    path = written(tmp_path / "run/plan.json", world, picture=str(photo))
    stored = read_world(path)
    assert picture_of(stored, path).path == photo
    beside = tmp_path / f"run/pictures/{world.picture.sha256[:16]}.jpg"
    beside.parent.mkdir()
    photo.rename(beside)
    assert picture_of(stored, path).path == beside
    moved = tmp_path / "moved"
    path.parent.rename(moved)
    path, beside = moved / path.name, moved / "pictures" / beside.name
    assert picture_of(stored, path).path == beside
    beside.unlink()
    with pytest.raises(ImageError, match=r"no longer at .*photo\.jpg; give it as the image"):
        picture_of(stored, path)
    assert picture_of(stored, path, load_picture(PHOTO)).path == PHOTO


def test_another_picture_is_refused(world: World, tmp_path: Path) -> None:
    photo = tmp_path / "photo.jpg"
    copyfile(PHOTO.with_name("ucm_parkinglot26.jpg"), photo)
    path = written(tmp_path / "plan.json", world, picture=str(photo))
    stored = read_world(path)
    for given in (None, load_picture(photo)):
        with pytest.raises(InputError, match="not the picture this was made for"):
            picture_of(stored, path, given)
    nowhere = StoredWorld(world=world)
    with pytest.raises(ImageError, match="is not beside it; give it as the image"):
        picture_of(nowhere, path)


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
