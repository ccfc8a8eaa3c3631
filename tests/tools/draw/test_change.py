"""Pictures of a change show who moves, joins and leaves."""

import numpy as np
from formup.tools.draw.change import draw_small, moves_between
from formup.tools.draw.overlay import draw_plan
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.world import World

PICTURE = picture_from_array(np.full((200, 300, 3), 120, dtype=np.uint8))
WORLD = World.of(PICTURE)
BEFORE = {"1": (50, 50), "2": (250, 50), "3": (50, 150)}
AFTER = {"1": (50, 50), "2": (250, 150), "4": (150, 100)}


def plan(places: dict[str, tuple[int, int]]) -> Plan:
    """Robots at places, listed with the last first: ids count, not the order."""
    group = Group.model_validate({"relation": "shape", "robots": len(places), "targets": ()})
    contract = Contract(groups=(group,))
    made = make_plan(contract, WORLD.site(contract), "s-1", np.array(list(places.values())))
    ids = list(reversed(places))
    return made.for_robots(list(places), ids)


def differs(shown: np.ndarray, plain: np.ndarray, x: float, y: float) -> bool:
    """Whether pictures differ around a point, given as shares of the width and the height."""
    row, column = int(y * plain.shape[0]), int(x * plain.shape[1])
    around = np.s_[max(row - 4, 0) : row + 5, max(column - 4, 0) : column + 5]
    return bool(np.abs(shown[around].astype(int) - plain[around]).max() > 30)


def test_robots_are_told_apart_by_their_ids() -> None:
    moves = moves_between(plan(BEFORE), plan(AFTER))
    assert list(moves.moved) == ["2"]
    assert np.allclose(moves.moved["2"], [BEFORE["2"], AFTER["2"]])
    assert list(moves.joined) == ["4"]
    assert list(moves.left) == ["3"]
    assert not moves_between(None, plan(AFTER)).joined


def test_arrows_lead_from_old_places_and_hide_no_new_one() -> None:
    after = plan(AFTER)
    plain = np.asarray(draw_plan(PICTURE, WORLD, after, ""))
    shown = np.asarray(draw_plan(PICTURE, WORLD, after, "", plan(BEFORE)))
    assert shown.shape == plain.shape
    photo = slice(0, round(200 * plain.shape[1] / 300))
    shown, plain = shown[photo], plain[photo]
    assert differs(shown, plain, 250 / 300, 50 / 200)
    assert differs(shown, plain, 250 / 300, 100 / 200)
    for x, y in AFTER.values():
        assert not differs(shown, plain, x / 300, y / 200)


def test_ways_lead_from_where_robots_start_and_hide_no_place() -> None:
    after = plan(AFTER)
    ways = {"1": np.array([(100, 20), (150, 60), AFTER["1"]], dtype=float)}
    plain = np.asarray(draw_plan(PICTURE, WORLD, after, ""))
    shown = np.asarray(draw_plan(PICTURE, WORLD, after, "", ways=ways))
    photo = slice(0, round(200 * plain.shape[1] / 300))
    shown, plain = shown[photo], plain[photo]
    for x, y in ((100, 20), (125, 40), (150, 60), (100, 55)):
        assert differs(shown, plain, x / 300, y / 200)
    for x, y in AFTER.values():
        assert not differs(shown, plain, x / 300, y / 200)
    stays = {"1": np.array([AFTER["1"], AFTER["1"]], dtype=float)}
    assert (np.asarray(draw_plan(PICTURE, WORLD, after, "", ways=stays))[photo] == plain).all()


def test_a_small_picture_fits_its_room_and_shows_moves() -> None:
    for room in ((80, 60), (60, 80), (7, 5)):
        small = draw_small(PICTURE, WORLD, plan(AFTER), plan(BEFORE), room)
        assert small.width <= room[0] and small.height <= room[1]
    small = np.asarray(draw_small(PICTURE, WORLD, plan(AFTER), plan(BEFORE), (90, 60)))
    still = np.asarray(draw_small(PICTURE, WORLD, plan(AFTER), None, (90, 60)))
    assert np.abs(small[26:35, 73:78].astype(int) - still[26:35, 73:78]).max() > 30
    nothing: tuple[Picture, World] = (PICTURE, WORLD)
    assert (np.asarray(draw_small(*nothing, None, None, (30, 20))) == 120).all()
