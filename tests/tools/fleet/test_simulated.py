"""Where simulated robots are set down, and how they drive."""

import asyncio
import math

import numpy as np
import pytest
import shapely
from formup.tools.errors import InputError
from formup.tools.fleet.protocol import FleetRequest, FleetSizeError, Motion, Pose, points_of
from formup.tools.fleet.simulated import (
    FULL_SPEED_S,
    MAX_ROBOTS,
    PERIOD,
    SLIP,
    SPEED_SHARE,
    SimulatedFleet,
    open_fleet,
)
from formup.tools.fleet.starts import checked_starts, spread_starts
from formup.tools.geometry.curves import Frame
from formup.tools.geometry.outline import FloatArray
from formup.tools.geometry.sampling import min_spacing
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

SIZE = (640.0, 480.0)
FRAME = Frame(*SIZE)
RADIUS = 4.0
SOLID = shapely.union(
    Polygon([(200, 150), (240, 150), (240, 270), (380, 270), (380, 150), (420, 150), (420, 330),
             (200, 330)]),
    shapely.box(500, 180, 560, 300),
)  # fmt: skip


def poses_of(fleet: SimulatedFleet) -> tuple[Pose, ...]:
    return asyncio.run(fleet.observe())


def request(robots: int, **more: object) -> FleetRequest:
    fields: dict[str, object] = {"solid": SOLID, "radius": RADIUS, **more}
    return FleetRequest(SIZE, robots, **fields)  # pyright: ignore[reportArgumentType]


def bad_starts() -> list[FloatArray]:
    good = np.array([(20.0, 20.0), (40, 20), (60, 20)])
    out, on = good.copy(), good.copy()
    out[1], on[2] = (700, 20), (203, 160)
    lost, gone = good.copy(), good.copy()
    lost[2, 0], gone[0, 1] = np.nan, np.inf
    return [out, on, lost, gone, good[:2], np.concatenate([good, good])]


@pytest.mark.parametrize("starts", bad_starts())
def test_starts_no_robot_can_have_are_refused(starts: FloatArray) -> None:
    with pytest.raises(InputError):
        open_fleet(request(3, starts=starts))


@pytest.mark.parametrize("place", [(300, 300), (203, 160), (201, 329), (198, 200), (530, 240)])
def test_a_start_on_a_target_is_refused_by_its_number(place: tuple[float, float]) -> None:
    starts = spread_starts(9, FRAME, SOLID, RADIUS)
    starts[4] = place
    with pytest.raises(InputError, match="Robot 5"):
        checked_starts(starts, 9, FRAME, SOLID, RADIUS)


@pytest.mark.parametrize(
    ("apart", "refused"), [(0, True), (2 * RADIUS - 0.5, True), (2 * RADIUS, False)]
)
def test_robots_may_touch_but_not_start_in_each_other(apart: float, refused: bool) -> None:
    starts = spread_starts(5, FRAME, SOLID, RADIUS)
    starts[3] = starts[1] + (apart, 0)
    if refused:
        with pytest.raises(InputError, match="Robots 2 and 4 start on the same spot"):
            checked_starts(starts, 5, FRAME, SOLID, RADIUS)
    else:
        checked_starts(starts, 5, FRAME, SOLID, RADIUS)


def test_starts_with_y_before_x_are_called_that() -> None:
    starts = np.array([[20.0, 30.0], [20.0, SIZE[0] - 20.0]])
    assert SIZE[1] < SIZE[0] - 20
    with pytest.raises(InputError, match="y before x"):
        checked_starts(starts, 2, FRAME, SOLID, RADIUS)


@pytest.mark.parametrize("n", [1, 2, 7, 60, 200, 400])
def test_spread_starts_are_free_apart_and_in_the_picture(n: int) -> None:
    starts = spread_starts(n, FRAME, SOLID, RADIUS)
    assert starts.shape == (n, 2)
    assert shapely.distance(SOLID, shapely.points(starts)).min() > RADIUS
    assert shapely.covers(Frame(*SIZE, RADIUS).box, shapely.points(starts)).all()
    if n > 1:
        assert min_spacing(starts) >= 2 * RADIUS
    assert np.array_equal(checked_starts(starts, n, FRAME, SOLID, RADIUS), starts)
    opened = poses_of(open_fleet(request(n)))
    assert np.array_equal(points_of(opened), starts)
    assert [pose.id for pose in opened] == [str(i) for i in range(1, n + 1)]


def test_more_robots_than_there_is_room_for_are_refused_in_words() -> None:
    with pytest.raises(InputError, match="of 900 robots"):
        spread_starts(900, FRAME, SOLID, 20.0)


def test_more_robots_than_are_simulated_are_refused() -> None:
    with pytest.raises(FleetSizeError, match="1001 robots can be placed"):
        open_fleet(request(MAX_ROBOTS + 1))


@settings(max_examples=30)
@given(st.integers(1, 12), st.integers(1, 30), st.booleans(), st.integers(0, 2**32 - 1))
def test_known_robots_stay_and_the_missing_are_set_down_beside_them(
    have: int, want: int, driven: bool, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform((10, 10), (630, 470), (400, 2))
    points = points[shapely.distance(SOLID, shapely.points(points)) > RADIUS]
    apart = [points[0]]
    for point in points:
        if np.linalg.norm(np.array(apart) - point, axis=1).min() > 2 * RADIUS:
            apart.append(point)
    known = tuple(
        Pose(str(i), float(x), float(y), None, 7.0) for i, (x, y) in enumerate(apart[:have], 1)
    )
    opened = poses_of(open_fleet(request(want, known=known, driven=driven)))
    assert opened[: len(known)] == known
    assert [pose.id for pose in opened] == [str(i) for i in range(1, max(len(known), want) + 1)]
    if len(opened) > 1:
        assert min_spacing(points_of(opened)) > 2 * RADIUS
    assert shapely.distance(SOLID, shapely.points(points_of(opened))).min() > RADIUS


def test_only_robots_never_driven_are_set_down_anew_off_a_new_target() -> None:
    known = tuple(Pose(str(i), x, 30.0) for i, x in enumerate((100.0, 200.0, 300.0), start=1))
    solid = shapely.box(180, 0, 220, 60)
    moved = poses_of(open_fleet(request(3, known=known, solid=solid)))
    assert (moved[0], moved[2]) == (known[0], known[2])
    assert solid.distance(shapely.Point(moved[1].x, moved[1].y)) > RADIUS
    assert poses_of(open_fleet(request(3, known=known, solid=solid, driven=True))) == known
    starts = points_of(known)
    with pytest.raises(InputError, match="Robot 2 starts"):
        open_fleet(request(3, known=known, solid=solid, starts=starts))


def test_robots_drive_at_a_finite_speed_and_slip_and_come_to_their_ends_all_the_same() -> None:
    fleet = open_fleet(request(3, seed=4))
    before = points_of(poses_of(fleet))
    ends = before + np.array([(300.0, 0), (100, 0), (0, 0)])
    paths = np.stack([before, ends], axis=1)

    async def go() -> list[tuple[Pose, ...]]:
        motion = Motion({str(i + 1): path for i, path in enumerate(paths)})
        return [poses async for poses in fleet.drive(motion)]

    frames = asyncio.run(go())
    speed = SPEED_SHARE * math.hypot(*SIZE)
    assert fleet.speed == speed
    assert [frame[0].seen for frame in frames] == pytest.approx(
        PERIOD * np.arange(1, len(frames) + 1)
    )
    moved = np.array([points_of(frame) for frame in frames]) - before
    assert 300 / speed < len(frames) * PERIOD < 300 / speed / (1 - SLIP) + 2 * FULL_SPEED_S + 0.5
    assert moved[-1] == pytest.approx(ends - before, abs=0.01)
    assert not moved[:, 2].any()
    steps = np.diff(moved[:, :2, 0], axis=0)
    assert steps.max() <= speed * PERIOD
    fastest = steps.max(axis=0)
    assert (fastest >= (1 - SLIP) * speed * PERIOD - 1e-9).all()
    assert fastest[0] != fastest[1]
