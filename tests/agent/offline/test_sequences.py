"""Formations one after the other, from the words of one instruction."""

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.tools.context import Settings
from formup.tools.fleet.protocol import Motion
from formup.tools.perception.image import Picture

RED, BLUE = (250, 220), (560, 300)


def test_a_ring_and_then_a_row_are_two_plans_each_driven_to(
    picture: Picture, drives: list[Motion]
) -> None:
    words = "First surround the red disc with 6 robots, then line up left of it"
    run = Agent().run(picture, words)
    assert run.report.status == "deployed"
    assert run.report.message.count("6 robots have certified places") == 2
    assert run.report.message.count("All arrived") == 2
    ring, row = (run.world.plans[name].plan for name in run.world.arrivals)
    assert [p.formation.contract.groups[0].relation for p in (ring, row)] == ["around", "along"]
    assert max(x for x, _ in row.formation.positions) < RED[0]
    begun = {robot: path[0] for robot, path in drives[-1].paths.items()}
    for robot, place in zip(ring.formation.robots, ring.formation.positions, strict=True):
        assert begun[robot] == pytest.approx(place, abs=1.0), "it begins where the ring stood"
    assert run.world.plans[row.id].motion is not None


def test_the_second_may_be_about_another_thing(picture: Picture) -> None:
    words = "surround the red disc with 5 robots and after that surround the blue disc"
    run = Agent().run(picture, words)
    assert run.report.status == "deployed"
    far = [float(np.hypot(*np.subtract(p, BLUE))) for p in run.report.positions or ()]
    assert len(far) == 5
    assert max(far) < 90
    assert [t.id for t in run.world.targets] == ["t1", "t2"]


def test_a_second_that_cannot_be_leaves_robots_at_the_first_and_says_so(picture: Picture) -> None:
    run = Agent().run(picture, "surround the red disc with 2 robots, then cage it")
    assert run.report.status == "failed"
    assert run.report.message.startswith("Took")
    assert "All arrived" in run.report.message
    assert len(run.world.arrivals) == 1
    assert run.report.arrival is not None


@pytest.mark.parametrize(
    "words",
    [
        "first put 3 robots left of the red disc, then 3 right of it",
        "surround the red disc with 6 robots, then line up left of it without stopping",
        "surround the red disc with 6 robots, then dance",
    ],
)
def test_what_is_not_clearly_one_after_the_other_is_asked_about(
    picture: Picture, words: str
) -> None:
    run = Agent().run(picture, words)
    assert run.report.status == "question"
    assert not run.world.plans


def test_where_robots_may_not_move_a_sequence_is_asked_about(picture: Picture) -> None:
    words = "surround the red disc with 6 robots, then line up left of it"
    run = Agent().run(picture, words, settings=Settings(may_deploy=False))
    assert run.report.status == "question"
    assert not run.world.plans


@pytest.mark.usefixtures("real")
def test_real_robots_wait_for_a_yes_to_each_plan(picture: Picture) -> None:
    words = "surround the red disc with 6 robots, then line up left of it"
    run = Agent().run(picture, words)
    assert run.report.status == "needs_approval"
    second = Agent().resume(run, approve=True)
    assert second.report.status == "needs_approval"
    assert second.report.plan_id != run.report.plan_id
    assert list(second.world.arrivals) == [run.report.plan_id]
    assert Agent().resume(second, approve=True).report.status == "deployed"


def test_formations_in_sequence_are_not_planned_where_nothing_may_move(picture: Picture) -> None:
    words = "First surround the red disc with 6 robots, then line up left of it"
    report = Agent().run(picture, words, settings=Settings(may_deploy=False)).report
    assert report.status == "question"
    assert "only one can be planned without moving robots" in report.message
