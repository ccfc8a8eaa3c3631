"""Dialogues with the offline planner about a plan that stands, with the real tools."""

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.outcomes import Paused
from formup.agent.session import Run
from formup.tools.context import Settings
from formup.tools.perception.image import Picture
from formup.tools.perception.target_prompt import TargetPrompt

RED, BLUE = (250, 220), (560, 300)
PLAN = Settings(may_deploy=False)


@pytest.fixture
def ring(picture: Picture) -> Run:
    """Eight robots around the red disc, planned only."""
    pointed = [TargetPrompt(points=(RED,))]
    return Agent().run(picture, "surround it with 8 robots", settings=PLAN, pointed=pointed)


def say(run: Run, *lines: str) -> Run:
    for words in lines:
        run = Agent().say(run, words, settings=PLAN)
    return run


def distances(run: Run, centre: tuple[int, int] = RED) -> list[float]:
    return [float(np.hypot(*np.subtract(at, centre))) for at in run.report.positions or ()]


def test_a_change_is_a_child_of_the_plan_that_stood(ring: Run) -> None:
    out = say(ring, "a bit further out")
    assert (out.report.status, out.report.parent) == ("planned", ring.report.plan_id)
    assert min(distances(out)) > max(distances(ring))
    more = say(out, "hm, a bit more")
    assert min(distances(more)) > max(distances(out))
    back = say(more, "back to the first one")
    assert back.report.plan_id == ring.report.plan_id


def test_the_other_way_turns_as_far_on_the_other_side(ring: Run) -> None:
    turned = say(ring, "turn it 20 degrees")
    other = say(turned, "the other way")
    straight = say(ring, "turn it 20 degrees counterclockwise")
    assert other.report.parent == turned.report.plan_id
    places = np.asarray(other.report.positions)
    assert places == pytest.approx(np.asarray(straight.report.positions), abs=1.0)


def test_the_only_other_thing_in_the_picture_is_the_other_one(ring: Run) -> None:
    moved = say(ring, "no, the other one")
    assert moved.report.status == "planned"
    assert max(distances(moved, BLUE)) < 100
    half = say(moved, "half of them back to the first one")
    near = [d < 100 for d in distances(half)]
    assert (sum(near), len(near)) == (4, 8)


def test_one_robot_goes_out_from_its_thing(ring: Run) -> None:
    moved = say(ring, "robot 2 further out by 20 px")
    ways = [b - a for a, b in zip(distances(ring), distances(moved), strict=True)]
    assert ways[1] == pytest.approx(20, abs=0.5)
    assert ways[:1] + ways[2:] == pytest.approx([0.0] * 7, abs=0.1)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("how many robots are there?", "8 robots: 1, 2, 3, 4, 5, 6, 7 and 8."),
        ("are they all there?", "No: no robot has moved to this plan yet; say go."),
        ("thanks", "You are welcome."),
        ("robot 9 left", "There is no robot 9: there are robots 1 to 8. Name one of those."),
    ],
)
def test_what_changes_nothing_is_answered(ring: Run, words: str, told: str) -> None:
    answered = say(ring, words)
    assert (answered.report.status, answered.report.plan_id) == ("answered", ring.report.plan_id)
    assert answered.report.message == told


def test_distances_are_those_that_are_measured(ring: Run) -> None:
    told = say(ring, "how far is robot 4?").report.message
    assert told.startswith("Robot 4 is ")
    assert float(told.split(" ")[3]) == pytest.approx(distances(ring)[3] - 45, abs=1.5)


def test_a_question_is_answered_by_the_number_of_an_option(ring: Run) -> None:
    asked = say(ring, "more robots")
    assert isinstance(asked.outcome, Paused)
    assert "2: two more robots" in asked.report.message
    answered = Agent().resume(asked, answer="2")
    assert len(answered.report.positions or ()) == 10


def test_an_answer_completes_what_was_asked_about(ring: Run) -> None:
    asked = say(ring, "20 px")
    answered = Agent().resume(asked, answer="further out")
    assert min(distances(answered)) - max(distances(ring)) == pytest.approx(20, abs=1.0)


def test_what_cannot_be_certified_changes_nothing(ring: Run) -> None:
    failed = say(ring, "move it 400 px to the left")
    assert failed.report.status == "impossible"
    assert failed.world.current == ring.report.plan_id


def test_a_sequence_is_confirmed_step_by_step(ring: Run) -> None:
    first = say(ring, "first further out, then two more")
    assert isinstance(first.outcome, Paused)
    assert min(distances(first)) > max(distances(ring))
    assert len(first.world.plan().plan.formation.positions) == 8
    assert len(Agent().resume(first, answer="yes").report.positions or ()) == 10


def test_words_choose_among_several_things_pointed_at(picture: Picture) -> None:
    pointed = [TargetPrompt(points=(RED,)), TargetPrompt(id="t2", points=(BLUE,))]
    for words, centre in (("put 6 robots around the right one", BLUE), ("6 robots around t1", RED)):
        run = Agent().run(picture, words, settings=PLAN, pointed=pointed)
        assert run.report.status == "planned"
        assert max(distances(run, centre)) < 100


@pytest.mark.parametrize(
    ("words", "answer", "robots"),
    [
        ("zorvel", "make it nine", 9),
        ("20", "in all", 20),
        ("more robots", "two", 10),
        ("20", "further out", 8),
    ],
)
def test_an_answer_may_be_a_command_of_its_own(
    ring: Run, words: str, answer: str, robots: int
) -> None:
    asked = say(ring, words)
    assert isinstance(asked.outcome, Paused)
    assert len(Agent().resume(asked, answer=answer).report.positions or ()) == robots


def test_an_answer_chooses_one_of_two(ring: Run) -> None:
    asked = say(ring, "move robot 3 or 4 a bit")
    moved = Agent().resume(asked, answer="3, outwards")
    far = [k for k, d in enumerate(distances(moved)) if d > max(distances(ring)) + 2]
    assert [(moved.report.robots or ())[k] for k in far] == ["3"]


@pytest.mark.parametrize("words", ["surround it", "cage it", "now around it", "surround this"])
def test_it_is_what_is_pointed_at_in_the_same_turn(ring: Run, words: str) -> None:
    pointed = [TargetPrompt(points=(BLUE,))]
    after = Agent().say(ring, words, settings=PLAN, pointed=pointed)
    assert after.report.status == "planned", after.report.message
    assert np.allclose(distances(after, BLUE), distances(after, BLUE)[0], atol=3)


def test_it_is_the_things_that_stands_where_nothing_is_pointed_at(ring: Run) -> None:
    after = say(ring, "cage it")
    assert max(distances(after, RED)) < 100


@pytest.mark.parametrize(
    ("answer", "at"),
    [("t1", RED), ("t2", BLUE), ("t2 please", BLUE), ("the first", RED), ("right", BLUE)],
)
def test_an_answer_says_which_of_several_things_is_meant(
    picture: Picture, answer: str, at: tuple[int, int]
) -> None:
    pointed = [TargetPrompt(id="t1", points=(RED,)), TargetPrompt(id="t2", points=(BLUE,))]
    words = "post nine sentries about the gizmo, 14 px off its edge"
    asked = Agent().run(picture, words, settings=PLAN, pointed=pointed)
    assert isinstance(asked.outcome, Paused)
    done = Agent().resume(asked, answer=answer)
    assert done.report.status == "planned", done.report.message
    assert np.allclose(distances(done, at), distances(done, at)[0], atol=4)


def test_an_answer_that_chooses_none_of_them_is_asked_about(picture: Picture) -> None:
    pointed = [TargetPrompt(id="t1", points=(RED,)), TargetPrompt(id="t2", points=(BLUE,))]
    asked = Agent().run(picture, "surround the gizmo", settings=PLAN, pointed=pointed)
    done = Agent().resume(asked, answer="the purple hat")
    assert done.report.status == "question"


@pytest.fixture
def named(picture: Picture) -> Run:
    """Five robots in a row below the red disc, which its person calls a plate."""
    pointed = [TargetPrompt(points=(RED,))]
    words = "line up 5 robots along the lower side of the plate, 12 px away"
    return Agent().run(picture, words, settings=PLAN, pointed=pointed)


def places(run: Run) -> np.ndarray:
    return np.asarray(run.report.positions)


def test_questions_of_what_stands_are_answered_by_measures(ring: Run) -> None:
    wide, high = np.ptp(places(ring).round(1), axis=0)
    told = {
        "which two robots are closest to each other": " px, centre to centre.",
        "how wide is the ring": f"All of it is {wide:.1f} px wide and {high:.1f} px high.",
        "are they at least 5 px apart": "Yes: each is ",
        "is anybody closer than 2 px to it": "No: the robots are ",
        "is nobody closer than 2 px to it": "Yes: the robots are ",
        "are they touching it": "No: robot ",
        "which side is free": "Robots stand on all sides of t1.",
        "how big is it": "t1 is 89",
    }
    for words, part in told.items():
        answered = say(ring, words)
        assert answered.report.status == "answered", words
        assert part in str(answered.report.message), (words, answered.report.message)


def test_a_robot_is_meant_by_where_it_stands(named: Run) -> None:
    at = places(named)
    left, right = int(at[:, 0].argmin()), int(at[:, 0].argmax())
    down = say(named, "move the leftmost robot 6 px down")
    both = say(down, "and the one on the far right too")
    moved = places(both) - at
    assert moved[[left, right]] == pytest.approx(np.array([[0.0, 6.0]] * 2), abs=0.1)
    assert np.delete(moved, [left, right], axis=0) == pytest.approx(0.0, abs=0.1)
    told = say(both, "which robot is furthest to the left?").report.message
    assert str(told).startswith(f"Robot {left + 1} is to stand at ")


def test_of_robots_that_stand_alike_one_is_chosen_by_its_number(ring: Run) -> None:
    asked = say(ring, "the robot in the middle 5 px further out")
    assert isinstance(asked.outcome, Paused)
    assert "alike: name it by its number" in str(asked.report.message)
    for answer in ("robot 3", "3"):
        moved = Agent().resume(asked, answer=answer)
        ways = [b - a for a, b in zip(distances(ring), distances(moved), strict=True)]
        assert ways[2] == pytest.approx(5, abs=0.5)


def test_two_robots_are_named_with_how_far_apart_they_stand(ring: Run) -> None:
    told = str(say(ring, "how near are the two closest robots").report.message).split()
    a, b, way = int(told[1]), int(told[3]), float(told[7])
    assert np.linalg.norm(places(ring)[a - 1] - places(ring)[b - 1]) == pytest.approx(way, abs=0.2)
    ways = np.linalg.norm(places(ring)[:, None] - places(ring)[None], axis=-1)
    assert ways[ways > 0].min() == pytest.approx(way, abs=0.2)


def test_what_was_pointed_at_keeps_the_name_it_was_given(named: Run) -> None:
    assert [t.label for t in named.world.targets] == ["plate"]
    faced = say(named, "turn them all to face the plate")
    assert faced.report.status == "planned"
    around = say(faced, "now around the plate instead of along it")
    assert max(distances(around)) - min(distances(around)) < 3
    assert len(around.world.targets) == 1
    other = say(named, "how far is robot 2 from the cup").report.message
    assert other == '"cup" is not measured yet: point at it, and ask again.'


def test_a_question_about_a_thing_gives_way_to_a_command_or_a_question(picture: Picture) -> None:
    pointed = [TargetPrompt(points=(RED,))]
    run = Agent().run(picture, "8 robots around the plate", settings=PLAN, pointed=pointed)
    asked = say(run, "now around the round one")
    assert isinstance(asked.outcome, Paused)
    still = Agent().resume(asked, answer="the shiny one")
    assert isinstance(still.outcome, Paused)
    told = Agent().resume(still, answer="how far apart are they?")
    assert str(told.report.message).startswith("Each is ")
    more = Agent().resume(still, answer="two more robots")
    assert len(more.report.positions or ()) == 10


def test_before_any_plan_help_says_how_to_begin(picture: Picture) -> None:
    for words in ("hello", "help"):
        said = Agent().run(picture, words, settings=PLAN).report.message
        assert "surround the coin with 6 robots" in said
        assert "further out" not in said
