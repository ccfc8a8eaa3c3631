"""A formation keeps about a thing that moves, within its bounds, and says which one it left."""

import asyncio
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from formup.tools.errors import ToolError
from formup.tools.fleet.assigning import assign_robots
from formup.tools.fleet.deploy import deploy
from formup.tools.fleet.escort import escort
from formup.tools.fleet.follow import Follow, Followed, Rigid
from formup.tools.fleet.physics import Physics
from formup.tools.fleet.protocol import Pose, Sighting, points_of
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.fleet.simulator import PERIOD
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.formation.site import Other, Site
from formup.tools.geometry.outline import make_outline
from formup.tools.geometry.sampling import min_spacing
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, box

SIZE, RADIUS = (1000, 480), 4.0
SITE = Site({"t1": make_outline([(200, 200), (300, 200), (300, 300), (200, 300)])}, *SIZE)
ON = {"path": [[0, 0], [400, 0], [400, 60]]}
AHEAD = {"path": [[0, 0], [4000, 0]]}
ROOM = Follow(seconds=8, speed=159)


def contract(relation: str = "around", robots: int = 6, **fields: Any) -> Contract:
    group = Group.model_validate(
        {"relation": relation, "targets": ("t1",), "robots": robots} | fields
    )
    return Contract(groups=(group,), robot_radius=RADIUS)


def team(targets: dict[str, Any], robots: int, seed: int = 0, **more: Any) -> SimulatedFleet:
    usual = {"speed": 160.0, "acceleration": 640.0, "radius": RADIUS, "slip": 0.02}
    physics = Physics.model_validate(usual | {"targets": targets} | more)
    poses = [Pose(str(i + 1), 20.0 + 30 * i, 440.0) for i in range(robots)]
    return SimulatedFleet(poses, physics=physics, seed=seed)


async def standing(plan: Plan, fleet: SimulatedFleet, site: Site) -> tuple[str, ...]:
    robots = assign_robots(await fleet.observe(), plan.formation.points).robots
    made = await deploy(plan, site, fleet, robots)
    assert made.arrival.arrived
    return made.arrival.robots


def followed(
    target: dict[str, Any],
    follow: Follow = ROOM,
    demanded: Contract | None = None,
    *,
    site: Site = SITE,
    **more: Any,
) -> Followed:
    """What comes of following."""
    plan = make_plan(demanded or contract(), site, "s")
    robots = plan.formation.contract.robots
    fleet = team({"t1": target}, robots, **more)

    async def work() -> Followed:
        places = await standing(plan, fleet, site)
        made = await escort(plan, site, fleet, places, follow)
        simulator = fleet._simulator  # pyright: ignore[reportPrivateUsage]
        held = simulator.points.copy()
        simulator.step()
        assert (simulator.points == held).all()
        return made

    return asyncio.run(work())


@pytest.mark.parametrize("speed", [5.0, 20.0, 40.0])
@pytest.mark.parametrize(
    "demanded",
    [contract(), contract("cage", 24), contract("cage", 16, closure="escape-proof")],
    ids=["around", "ring", "escape-proof"],
)
def test_a_thing_that_moves_slowly_is_kept_in_formation_all_the_time(
    demanded: Contract, speed: float
) -> None:
    came = followed(ON | {"speed": speed}, demanded=demanded)
    assert (came.ended, came.reason, came.certified) == ("time", None, 1.0)
    assert came.lag_px <= speed * 2 * PERIOD
    assert came.moved_px == pytest.approx(8 * speed, abs=2)
    places = make_plan(demanded, SITE, "s").formation.points
    assert came.separation_px is not None
    assert came.separation_px >= min_spacing(places) - 2 * came.lag_px - 0.5


def test_a_thing_that_is_too_fast_for_the_robots_is_said() -> None:
    came = followed(AHEAD | {"speed": 150}, demanded=contract("corners", 4))
    assert came.ended == "contract"
    assert came.reason is not None
    assert "behind their places about t1, which moves them at 150 px/s: Robot" in came.reason
    assert came.reason.endswith("All robots hold.")
    assert came.certified < 1


def test_no_robot_is_taken_along_faster_than_was_allowed() -> None:
    came = followed(AHEAD | {"speed": 30}, Follow(speed=20))
    assert came.ended == "speed"
    assert came.reason == (
        "t1 takes robots along at 30.0 px/s; no more than 20 px/s were allowed. All robots hold."
    )
    assert came.seconds <= 0.3


def test_robots_stay_in_the_area() -> None:
    came = followed(AHEAD | {"speed": 40}, Follow(speed=60, area=(100, 100, 420, 400)))
    assert came.ended == "area"
    assert "would leave the area" in str(came.reason)
    assert 30 <= came.moved_px <= 420 - 300


@pytest.mark.parametrize("named", [True, False], ids=["keep-out", "thing"])
def test_what_stands_in_the_way_stops_them(named: bool) -> None:
    tree = box(450, 200, 480, 300)
    demanded, site = contract(), replace(SITE, others=(Other("c3", "tree", tree),))
    if named:
        demanded = demanded.model_copy(update={"keep_out": ("k1",)})
        wall = make_outline(list(tree.exterior.coords)[:-1])
        site = replace(SITE, outlines={**SITE.outlines, "k1": wall})
    came = followed(AHEAD | {"speed": 40}, Follow(speed=60), demanded, site=site)
    assert came.ended == "obstacle"
    assert ("would touch k1." if named else "would touch c3 (tree).") in str(came.reason)
    furthest = max(x for x, _ in make_plan(demanded, site, "s").formation.positions)
    assert 450 - 60 < furthest + came.moved_px < 450 - RADIUS


def test_robots_without_a_place_are_in_the_way_too() -> None:
    plan, fleet = make_plan(contract(), SITE, "s"), team({"t1": AHEAD | {"speed": 40}}, 7)
    sited = {pose.id: pose for pose in asyncio.run(fleet.observe())}

    async def work() -> Followed:
        robots = assign_robots(tuple(sited.values())[:6], plan.formation.points).robots
        made = await deploy(plan, SITE, fleet, robots)
        simulator = fleet._simulator  # pyright: ignore[reportPrivateUsage]
        simulator.points[6] = simulator.sensed[6] = (500, max(plan.formation.positions)[1])
        return await escort(plan, SITE, fleet, made.arrival.robots, Follow(speed=60))

    came = asyncio.run(work())
    assert (came.ended, "would touch robot 7" in str(came.reason)) == ("obstacle", True)


@given(seed=st.integers(0, 10_000), speed=st.floats(2, 25))
@settings(max_examples=12, deadline=None)
def test_a_random_walk_is_followed_as_far_as_there_is_room(seed: int, speed: float) -> None:
    came = followed({"walk": speed}, Follow(seconds=5, speed=60), seed=seed)
    assert came.ended in ("time", "area")
    assert came.certified == 1.0
    assert came.lag_px <= 3 * PERIOD * speed + 0.5
    assert 0 < came.moved_px <= 5 * speed + 1


def test_a_push_and_a_turn_are_followed() -> None:
    pushed = followed({"pushed": [{"at": 1, "by": [30, -10]}]})
    assert (pushed.ended, pushed.certified) == ("time", 1.0)
    assert pushed.moved_px == pytest.approx(math.hypot(30, 10), abs=1e-3)
    turned = followed({"turn": 20})
    assert (turned.ended, turned.certified, turned.moved_px) == ("time", 1.0, 0.0)
    assert turned.speed_px_s > 20


@pytest.mark.parametrize(
    ("more", "speed"),
    [
        ({"drive": "differential"}, 20),
        ({"noise": {"actuation": 0.05, "sensing": 0.1}, "delay": 0.1, "drop_outs": 0.05}, 20),
    ],
    ids=["wheels", "noise"],
)
def test_wheels_and_noise_only_take_more_room(more: dict[str, Any], speed: float) -> None:
    came = followed(ON | {"speed": speed}, **more)
    assert (came.ended, came.certified) == ("time", 1.0)
    assert came.lag_px <= 0.3 * speed


def test_a_stop_holds_them_within_a_step() -> None:
    plan, fleet = make_plan(contract(), SITE, "s"), team({"t1": AHEAD | {"speed": 40}}, 6)
    seen: list[np.ndarray[Any, Any]] = []

    async def work() -> Followed:
        robots = await standing(plan, fleet, SITE)

        def watch(poses: tuple[Pose, ...], rigid: Rigid) -> None:
            seen.append(points_of(poses))
            if len(seen) == 30:
                asyncio.get_running_loop().call_soon(asyncio.ensure_future, fleet.stop())

        return await escort(plan, SITE, fleet, robots, ROOM, watch=watch)

    came = asyncio.run(work())
    assert came.ended == "stopped"
    assert len(seen) <= 31
    assert np.allclose(points_of(asyncio.run(fleet.observe())), seen[-1], atol=160 * PERIOD)


class Blind(SimulatedFleet):
    """Loses sight of the thing."""

    looks = 0

    async def sightings(self) -> tuple[Sighting, ...]:
        self.looks += 1
        return await super().sightings() if self.looks < 40 else ()


def test_a_thing_that_is_lost_sight_of_is_not_followed_blindly() -> None:
    plan, made = make_plan(contract(), SITE, "s"), team({"t1": AHEAD | {"speed": 5}}, 6)
    made.__class__ = Blind

    async def work() -> Followed:
        return await escort(plan, SITE, made, await standing(plan, made, SITE), ROOM)

    came = asyncio.run(work())
    assert came.ended == "unseen"
    assert "t1 was not seen for 1." in str(came.reason)


@pytest.mark.parametrize(
    ("targets", "follow", "demanded", "words"),
    [
        ({}, ROOM, contract(), "does not see where t1 is, so it cannot follow it"),
        ({"t2": {"walk": 3}}, ROOM, contract(), "does not see where t1 is"),
        (
            {"t1": {"walk": 3}},
            Follow(speed=500),
            contract(),
            "drive 160 px/s at most: they cannot follow at up to 500 px/s",
        ),
        (
            {"t1": {"walk": 3}},
            ROOM,
            Contract(groups=(Group(relation="at", robots=1, points=((50, 50),)),)),
            "follow one thing; this formation is about no thing",
        ),
    ],
)
def test_what_cannot_be_followed_is_refused_in_a_sentence(
    targets: dict[str, Any], follow: Follow, demanded: Contract, words: str
) -> None:
    plan, fleet = make_plan(demanded, SITE, "s"), team(targets, demanded.robots)
    with pytest.raises(ToolError, match=words):
        asyncio.run(escort(plan, SITE, fleet, plan.formation.robot_of_place, follow))


angle, way = st.floats(-10, 10), st.floats(-500, 500)


@given(turn=angle, dx=way, dy=way, points=st.lists(st.tuples(way, way), min_size=2, max_size=9))
def test_what_moves_with_a_thing_keeps_its_form(
    turn: float, dx: float, dy: float, points: list[tuple[float, float]]
) -> None:
    rigid, form = Rigid(np.array([30.0, 70.0]), Sighting("t1", dx, dy, turn)), np.array(points)
    moved = rigid.carried(form)
    assert np.allclose(rigid.back(moved), form, atol=1e-6)
    assert np.linalg.norm(moved[0] - moved[1]) == pytest.approx(
        float(np.linalg.norm(form[0] - form[1])), abs=1e-6
    )
    assert rigid.moved(Point(form[0]).buffer(5)).centroid.distance(Point(moved[0])) < 1e-6


def test_leave_is_said_in_figures() -> None:
    assert Follow().said("t1", (640, 480)) == (
        "follow t1 for 60 s at no more than 40 px/s within the picture"
    )
    given = Follow(seconds=5, speed=2.5, area=(0, 1, 20, 30)).said("t2", (640, 480))
    assert given == "follow t2 for 5 s at no more than 2.5 px/s within (0, 1) to (20, 30)"
