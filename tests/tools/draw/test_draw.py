from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.tools.draw import draw_deployment, draw_look, draw_plan, save_gif
from formup.tools.draw.canvas import Canvas
from formup.tools.draw.rulers import RULER
from formup.tools.draw.text import drawable
from formup.tools.errors import InputError, ToolError
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import FloatArray, make_outline
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.world import Target, World
from PIL import Image

ROBOT, FINDING = (0, 92, 184), (214, 30, 38)
TITLE_TEXTS = [
    "",
    " \n\t ",
    "two\nlines\r\nand a tab\t.",
    "x" * 5000,
    "word " * 2000,
    "円を描いて硬貨を囲む 🤖👩‍🚀 вокруг монеты",
    "أحط بالعملة بثمانية روبوتات",
    "הקף את המטבע",
    "\u202eabc\u0000\ud800",
]


Made = tuple[Picture, World]


def scene(
    width: int = 300, height: int = 200, grey: int = 120, boxes: Sequence[float] = (0.35,)
) -> Made:
    """One target per entry: its left edge as a share of the width, a third of the height high."""
    picture = picture_from_array(np.full((height, width, 3), grey, dtype=np.uint8))
    world = World.of(picture)
    side = min(width, height) / 3
    for k, share in enumerate(boxes, start=1):
        x, y = share * width, height / 3
        ring = [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]
        outline = make_outline(ring)
        target = Target(
            id=f"t{k}",
            label="thing",
            box=outline.bounds,
            confidence=0.9,
            outline=outline,
            prompt="box",
        )
        world = world.with_target(target)
    return picture, world


def plan_for(made: Made, positions: object = None, **group: object) -> Plan:
    given: dict[str, object] = {"relation": "around", "targets": ("t1",), "robots": 6} | group
    contract = Contract(groups=(Group.model_validate(given),))
    points = None if positions is None else np.asarray(positions, dtype=float)
    world = made[1]
    return make_plan(contract, world.site(contract), world.version_of(contract), points)


def free_plan(made: Made, positions: object) -> Plan:
    points = np.asarray(positions, dtype=float).reshape(-1, 2)
    return plan_for(made, points, relation="shape", targets=(), robots=len(points))


def photo_box(image: Image.Image, grey: int = 120) -> tuple[int, int, int, int]:
    """Where the photograph lies, by the first and last rows and columns that show its grey."""
    there = (np.asarray(image) == grey).all(axis=2)
    rows, columns = np.flatnonzero(there.any(axis=1)), np.flatnonzero(there.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def on_page(image: Image.Image, made: Made, points: FloatArray) -> FloatArray:
    x0, y0, x1, y1 = photo_box(image)
    scale = np.array([(x1 - x0) / made[0].width, (y1 - y0) / made[0].height])
    return np.array([x0, y0]) + (points + 0.5) * scale - 0.5


def centre_of(image: Image.Image, colour: tuple[int, int, int]) -> FloatArray:
    rows, columns = np.nonzero((np.asarray(image) == colour).all(axis=2))
    return np.array([columns.mean(), rows.mean()])


@pytest.mark.parametrize("size", [(300, 200), (200, 300), (16, 16), (4000, 2500), (401, 397)])
def test_a_robots_disc_is_exactly_where_it_stands(size: tuple[int, int]) -> None:
    made = scene(*size, boxes=())
    place = np.array([[round(0.37 * size[0]), round(0.61 * size[1])]], dtype=float)
    image = draw_plan(*made, free_plan(made, place), "")
    wanted = on_page(image, made, place)[0]
    assert np.abs(centre_of(image, ROBOT) - wanted).max() < 0.6


def test_every_robot_has_a_disc() -> None:
    made = scene()
    plan = plan_for(made, robots=8)
    image = draw_plan(*made, plan, "Ring it.")
    pixels = np.asarray(image)
    for x, y in on_page(image, made, plan.formation.points).round().astype(int):
        window = pixels[y - 12 : y + 13, x - 12 : x + 13]
        assert (window == ROBOT).all(axis=2).sum() > 40


def test_robots_with_a_finding_are_red_and_only_they() -> None:
    made = scene()
    good = plan_for(made, relation="cage", robots=8)
    assert not (np.asarray(draw_plan(*made, good, "")) == FINDING).all(axis=2).any()
    points = good.formation.points.copy()
    points[2] = made[1].targets[0].outline.centre
    bad = plan_for(made, points, relation="cage", robots=8)
    assert not bad.verdict.certified
    image = draw_plan(*made, bad, "")
    pixels = np.asarray(image)
    flagged = {f.robot for f in bad.verdict.findings}
    for robot, (x, y) in enumerate(on_page(image, made, points).round().astype(int), start=1):
        window = pixels[y - 8 : y + 9, x - 8 : x + 9]
        assert (window == FINDING).all(axis=2).any() == (robot in flagged)


@pytest.mark.parametrize("size", [(16, 16), (400, 300), (768, 432), (3000, 4000)])
def test_the_photograph_is_shown_at_a_size_people_can_read(size: tuple[int, int]) -> None:
    made = scene(*size, boxes=())
    image = draw_plan(*made, free_plan(made, [[1, 1]]), "A title")
    x0, y0, x1, y1 = photo_box(image)
    assert 900 <= max(x1 - x0, y1 - y0) <= 1600
    assert (x1 - x0) / (y1 - y0) == pytest.approx(size[0] / size[1], rel=0.01)
    assert max(draw_look(*made).size) <= 1650


@pytest.mark.parametrize("size", [(300, 200), (1999, 1100), (90, 350)])
def test_rulers_are_exact(size: tuple[int, int]) -> None:
    made = scene(*size, boxes=())
    image = draw_look(*made)
    pixels = np.asarray(image.convert("L")).astype(float)
    x0, y0, x1, y1 = photo_box(image)
    for axis, near in ((0, y0), (1, x0)):
        strip = pixels[near - 3, x0:x1] if axis == 0 else pixels[y0:y1, near - 3]
        ink = 246 - strip
        starts = np.flatnonzero((ink > 20) & (np.append(0, ink[:-1]) <= 20))
        scale = len(strip) / size[axis]
        found = [
            np.average(np.arange(s, s + 5), weights=np.maximum(ink[s : s + 5], 0)) for s in starts
        ]
        values = (np.array(found[1:]) + 0.5) / scale - 0.5  # the first may be cut by the corner
        step = round(float(np.diff(values).mean()))
        assert np.abs(values - step * np.arange(1, len(values) + 1)).max() < 0.6 / scale


def test_a_look_shows_targets() -> None:
    plain = draw_look(*scene(boxes=()))
    left, top, right, bottom = RULER
    assert plain.size == (1200 + left + right, 800 + top + bottom)
    changed = (np.asarray(draw_look(*scene())) != np.asarray(plain)).any(axis=2)[top:, left:]
    assert changed[4 * 95 : 4 * 105, 417:423].any()  # its left edge, x = 105 at scale 4


GROUPS: list[dict[str, object]] = [
    {"relation": "around"},
    {"relation": "around", "robots": 1},
    {"relation": "around", "robots": 3, "spacing": "free"},
    {"relation": "corners", "robots": 4},
    {"relation": "corners", "robots": 1},
    {"relation": "along", "side": "bottom"},
    {"relation": "along", "edges": (0, 1)},
    {"relation": "inside", "robots": 5},
    {"relation": "between", "targets": ("t1", "t2"), "robots": 3},
    {"relation": "between", "targets": ("t1", "t2"), "robots": 3, "layout": "divider"},
    {"relation": "centre", "robots": 2},
    {"relation": "shape", "targets": (), "line": (5, 5, 280, 20)},
    {"relation": "around", "clearance": (1, 100_000)},
]


@pytest.mark.parametrize("group", GROUPS, ids=lambda g: "-".join(map(str, g.values())))
def test_every_relation_is_drawn(group: dict[str, object]) -> None:
    made = scene(boxes=(0.1, 0.6))
    plan = plan_for(made, **group)
    image = draw_plan(*made, plan, "x")
    assert (np.asarray(image) == ROBOT).all(axis=2).any()


def test_several_groups_with_bodies_and_a_target_to_keep_out_of() -> None:
    made = scene(600, 400, boxes=(0.05, 0.4, 0.75))
    contract = Contract(
        groups=(
            Group(relation="cage", targets=("t1",), robots=6),
            Group(relation="inside", targets=("t2",), robots=3),
        ),
        robot_radius=4,
        keep_out=("t3",),
    )
    plan = make_plan(contract, made[1].site(contract), made[1].version_of(contract))
    assert draw_plan(*made, plan, "Two jobs").width == 1200


@pytest.mark.parametrize("title", TITLE_TEXTS, ids=range(len(TITLE_TEXTS)))
def test_any_title_can_be_drawn(title: str) -> None:
    made = scene(64, 48, boxes=())
    plan = free_plan(made, [[20, 20]])
    image = draw_plan(*made, plan, title)
    assert image.height < 900 + 200
    assert max(draw_deployment(*made, plan, [plan.formation.points], title)[0].size) <= 640


def test_what_the_font_lacks_is_named() -> None:
    assert drawable("Größe – é\n×2") == "Grosse - e x2"
    assert drawable("встань вокруг monety 🤖") == "[Cyrillic] monety [robot face]"
    assert drawable("أحط ب٨") == "[Arabic] 8"


@pytest.mark.parametrize("size", [(16, 16), (20_000, 16), (16, 3000)])
def test_pictures_of_extreme_shape(size: tuple[int, int]) -> None:
    made = scene(*size, boxes=())
    plan = free_plan(made, [[0, 0], [size[0] - 1, size[1] - 1], [8, 8]])
    assert draw_plan(*made, plan, "A long title for a narrow picture " * 5).width >= 600
    assert draw_look(*made).width > 0
    frames = [plan.formation.points] * 2
    assert max(draw_deployment(*made, plan, frames, "t")[0].size) <= 640


def test_robots_nowhere_and_far_away_do_no_harm() -> None:
    made = scene()
    for wrong in (float("nan"), float("inf"), 1e12, -5000.0):
        plan = plan_for(made, [[wrong, 5.0], [20, 20], [30, 90], [250, 90]], robots=4)
        image = draw_plan(*made, plan, "t")
        assert not plan.verdict.certified
        assert (np.asarray(image) == FINDING).all(axis=2).any()
    short = plan_for(made, [[20, 20]], robots=4)
    assert draw_plan(*made, short, "t").width == 1200
    assert draw_plan(*made, plan_for(made, np.empty((0, 2))), "t").width == 1200


def test_robots_on_one_place_do_no_harm() -> None:
    made = scene()
    assert draw_plan(*made, plan_for(made, [[20, 20]] * 6), "t").width == 1200


def test_ten_thousand_robots() -> None:
    made = scene(800, 800, boxes=())
    x, y = np.meshgrid(np.arange(100), np.arange(100))
    plan = free_plan(made, np.stack([x, y], axis=-1).reshape(-1, 2) * 8.0)
    image = draw_plan(*made, plan, "Many")
    assert (np.asarray(image) == ROBOT).all(axis=2).sum() > 10_000
    frames = [plan.formation.points + 2, plan.formation.points]
    assert len(draw_deployment(*made, plan, frames, "Many")) == 2


def test_a_scene_without_the_target_is_refused() -> None:
    plan = plan_for(scene())
    other = scene(boxes=())
    with pytest.raises(ToolError, match="t1"):
        draw_plan(*other, plan, "")
    with pytest.raises(ToolError, match="t1"):
        draw_deployment(*other, plan, [plan.formation.points], "")


def drive(plan: Plan, count: int) -> list[FloatArray]:
    goals = plan.formation.points
    start = np.stack([np.linspace(10, 290, len(goals)), np.full(len(goals), 190.0)], axis=1)
    return [start + (goals - start) * share for share in np.linspace(0, 1, count)]


def test_a_deployment_has_one_picture_per_frame_and_ends_arrived() -> None:
    made = scene()
    plan = plan_for(made)
    frames = drive(plan, 5)
    images = draw_deployment(*made, plan, frames, "Ring")
    assert len(images) == 5
    assert {i.size for i in images} == {images[0].size}
    assert max(images[0].size) <= 640
    green = (0, 122, 90)
    shown = [bool((np.asarray(i) == green).all(axis=2).any()) for i in images]
    assert shown == [False] * 4 + [True]
    assert draw_deployment(*made, plan, [], "Ring") == []


def test_a_deployment_that_fell_short_does_not_say_arrived() -> None:
    made = scene()
    plan = plan_for(made)
    last = np.asarray(draw_deployment(*made, plan, drive(plan, 3)[:2], "Ring")[-1])
    assert (last == FINDING).all(axis=2).any()
    assert not (last == (0, 122, 90)).all(axis=2).any()


def test_robots_in_a_film_are_where_they_are() -> None:
    made = scene(boxes=())
    plan = free_plan(made, [[100, 50]])
    image = draw_deployment(*made, plan, [np.array([[200.0, 120.0]])] * 2, "")[0]
    wanted = on_page(image, made, np.array([[200.0, 120.0]]))[0]
    assert np.abs(centre_of(image, ROBOT) - wanted).max() < 1.2


def test_pictures_and_films_number_robots_by_their_ids(monkeypatch: pytest.MonkeyPatch) -> None:
    made, written = scene(), list[str]()
    write = Canvas.text

    def text(canvas: Canvas, where: FloatArray, words: str, *more: Any) -> None:
        written.append(words)
        write(canvas, where, words, *more)

    monkeypatch.setattr(Canvas, "text", text)
    plan = plan_for(made, relation="around", robots=3).for_robots(("7", "9", "4"), ("4", "7", "9"))
    draw_plan(*made, plan, "Ring")
    assert {word for word in written if word.isdigit()} == {"4", "7", "9"}
    written.clear()
    draw_deployment(*made, plan, drive(plan, 3)[:2], "Ring")
    assert {word for word in written if word.isdigit()} == {"4", "7", "9"}


def durations(path: Path) -> tuple[list[int], tuple[int, int], int]:
    with Image.open(path) as film:
        times: list[int] = []
        for k in range(getattr(film, "n_frames", 1)):
            film.seek(k)
            times.append(film.info["duration"])
        return times, film.size, film.info["loop"]


def test_a_gif_is_thinned_holds_its_last_frame_and_loops(tmp_path: Path) -> None:
    made = scene()
    plan = plan_for(made)
    path = tmp_path / "film.gif"
    save_gif(draw_deployment(*made, plan, drive(plan, 90), "Ring"), path)
    times, size, loop = durations(path)
    assert len(times) == 48
    assert set(times[:-1]) == {80}
    assert times[-1] == 2000
    assert max(size) <= 640
    assert loop == 0
    assert [p.name for p in tmp_path.iterdir()] == ["film.gif"]


def test_a_gif_of_one_frame_and_of_none(tmp_path: Path) -> None:
    save_gif([Image.new("RGB", (1600, 800), "red")], tmp_path / "one.gif")
    with Image.open(tmp_path / "one.gif") as film:
        assert film.size == (640, 320)
    with pytest.raises(InputError, match="no frames"):
        save_gif([], tmp_path / "none.gif")


def test_a_gif_of_noise_stays_small(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    noise = [
        Image.fromarray(random.integers(0, 255, (480, 640, 3), dtype=np.uint8)) for _ in range(16)
    ]
    save_gif(noise, tmp_path / "noise.gif")
    assert (tmp_path / "noise.gif").stat().st_size <= 3_000_000


def test_a_gif_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "film.gif").mkdir()
    with pytest.raises(InputError, match=r"film\.gif cannot be written"):
        save_gif([Image.new("RGB", (32, 32))], tmp_path / "film.gif")
    assert [p.name for p in tmp_path.iterdir()] == ["film.gif"]


def test_a_robot_that_looks_somewhere_has_a_nose_there() -> None:
    made = scene()
    plain, looking = (
        np.asarray(draw_plan(*made, plan_for(made, **more), "Look").convert("L"), dtype=int)
        for more in ({}, {"heading": 0.0})
    )
    assert plain.shape == looking.shape
    rows, columns = np.nonzero(plain != looking)
    assert len(rows)
    plan = plan_for(made)
    x, y = plan.formation.points[0]
    scale = 4.0  # 300 px are drawn 1200 wide
    left, top, *_ = photo_box(draw_plan(*made, plan, "Look"))
    assert (columns > left + scale * x).any() and (abs(rows - top - scale * y) < 20).any()
