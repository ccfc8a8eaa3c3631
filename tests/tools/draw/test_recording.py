"""Films as files: what was drawn is read back from them."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from formup.tools.draw import save_film
from formup.tools.draw.canvas import CERTIFIED, TARGET
from formup.tools.draw.film import draw_deployment
from formup.tools.draw.recording import LAST_MS, STRIP_GAP, TICK_MS, save_mp4, save_strip
from formup.tools.errors import InputError, StorageError
from formup.tools.fleet.follow import Rigid
from formup.tools.fleet.protocol import Sighting
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import FloatArray, make_outline
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.world import Target, World
from PIL import Image

RESTING = LAST_MS // TICK_MS - 1
Made = tuple[Picture, World, Plan, list[FloatArray]]


def made(moments: int = 20) -> Made:
    """Two robots that come from below to a square's sides."""
    picture = picture_from_array(np.full((200, 300, 3), 230, dtype=np.uint8))
    outline = make_outline([(120, 60), (180, 60), (180, 120), (120, 120)])
    target = Target(
        id="t1", label="box", box=outline.bounds, confidence=1, outline=outline, prompt="box"
    )
    world = World.of(picture).with_target(target)
    contract = Contract(groups=(Group(relation="around", targets=("t1",), robots=2),))
    places, site = [(90.0, 90.0), (210.0, 90.0)], world.site(contract)
    plan = make_plan(contract, site, world.version_of(contract), places)
    ways = np.linspace(0, 1, moments)
    return (
        picture,
        world,
        plan,
        [plan.formation.points + np.array([0, 80 * (1 - way)]) for way in ways],
    )


def test_an_mp4_shows_every_moment_and_rests_on_the_last(tmp_path: Path) -> None:
    scene = made()
    save_film(tmp_path / "film.mp4", *scene, "Two")
    film, shown = cv2.VideoCapture(str(tmp_path / "film.mp4")), list[np.ndarray]()
    while (read := film.read())[0]:
        shown.append(read[1][:, :, ::-1])
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(1000 / TICK_MS)
    drawn = draw_deployment(*scene, "Two", side=960)
    assert len(shown) == len(drawn) + RESTING
    for image, frame in zip([*drawn, drawn[-1]], shown, strict=False):
        page = np.asarray(image)
        assert np.abs(frame[: page.shape[0], : page.shape[1]] - page.astype(int)).mean() < 6
    assert [p.name for p in tmp_path.iterdir()] == ["film.mp4"]


def test_a_thing_that_is_followed_is_drawn_where_it_was_seen() -> None:
    picture, world, plan, frames = made(4)
    rigid = Rigid(np.array([150.0, 90.0]), Sighting("t1", 40.0, 60.0))
    moved = [*frames[:3], rigid.carried(plan.formation.points)]
    still = draw_deployment(picture, world, plan, moved, "Two")
    shown = draw_deployment(picture, world, plan, moved, "Two", moved=[rigid])
    assert shown[:3] == still[:3]
    arrived = [(np.asarray(page[3]) == CERTIFIED).all(axis=2).any() for page in (shown, still)]
    assert arrived == [True, False]
    outlined = [(np.asarray(page[3]) == TARGET).all(axis=2).sum() for page in (shown, still)]
    assert outlined[0] > 1.5 * outlined[1] > 0


def test_an_mp4_of_odd_sides_is_padded(tmp_path: Path) -> None:
    save_mp4([Image.new("RGB", (101, 63), "red")], tmp_path / "odd.mp4")
    ok, frame = cv2.VideoCapture(str(tmp_path / "odd.mp4")).read()
    assert ok and frame.shape == (64, 102, 3)
    assert frame[30, 50, 2] > 200 > 60 > frame[30, 50, 0]


def test_a_strip_holds_the_first_the_last_and_moments_between(tmp_path: Path) -> None:
    scene = made()
    save_film(tmp_path / "strip.png", *scene, "Two")
    frames = draw_deployment(*scene, "Two")
    width, height = frames[0].size
    with Image.open(tmp_path / "strip.png") as strip:
        assert strip.size == (3 * width + 2 * STRIP_GAP, 2 * height + STRIP_GAP)
        places = [(x, y) for y in (0, height + STRIP_GAP) for x in range(3)]
        for (column, y), moment in zip(places, (0, 4, 8, 11, 15, 19), strict=True):
            x = column * (width + STRIP_GAP)
            assert strip.crop((x, y, x + width, y + height)) == frames[moment]


def test_a_strip_of_few_frames_is_no_wider(tmp_path: Path) -> None:
    save_strip([Image.new("RGB", (60, 40), "red")] * 2, tmp_path / "two.png")
    with Image.open(tmp_path / "two.png") as strip:
        assert strip.size == (120 + STRIP_GAP, 40)


def test_a_name_of_no_film_and_no_frames_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"film\.avi is no film's name; let it end in \.gif"):
        save_film(tmp_path / "film.avi", *made(), "Two")
    for save in (save_mp4, save_strip):
        with pytest.raises(InputError, match="no frames"):
            save([], tmp_path / "none")
    (tmp_path / "taken.mp4").mkdir()
    with pytest.raises(StorageError, match="cannot be written"):
        save_mp4([Image.new("RGB", (32, 32))], tmp_path / "taken.mp4")
