"""Words that have a thing followed, and no others; what they leave is read as ever."""

from pathlib import Path

import pytest
from formup.agent.agent import Agent
from formup.agent.offline.escorting import without_follow
from formup.agent.session import Run
from formup.tools.context import Settings
from formup.tools.perception.image import Picture
from formup.tools.perception.target_prompt import TargetPrompt

BOX = TargetPrompt(box=(55, 35, 125, 95))
SLOW = "fleet: simulated\ntargets: {t1: {path: [[0, 0], [30, 10]], speed: 4}}\n"


@pytest.mark.parametrize(
    ("words", "left", "leave"),
    [
        ("follow it", "go", {}),
        ("Escort it, please.", "go", {}),
        ("ok, follow it for a minute", "go", {"seconds": 60}),
        ("keep up with it at no more than 20 px/s", "go", {"speed": 20}),
        ("stay with it while it moves", "go", {}),
        ("go and follow it for 30 seconds", "go", {"seconds": 30}),
        ("follow it for half a minute at 15 pixels per second", "go", {"seconds": 30, "speed": 15}),
        ("can you follow it for one and a half minutes?", "go", {"seconds": 90}),
        ("follow it at up to 0.5 m/s", "go", {"speed": 10}),
        ("follow the red car", "go", {}),
        ("follow t1 for 5 s", "go", {"seconds": 5}),
        ("surround the coin with 6 robots and follow it", "surround the coin with 6 robots", {}),
        ("cage it with 9 robots, then keep pace with it", "cage it with 9 robots", {}),
        ("surround the van while it moves around", "surround the van", {}),
        ("surround the van, follow the van wherever it goes", "surround the van", {}),
        ("follow it for ten seconds and a bit closer", "a bit closer", {"seconds": 10}),
    ],
)
def test_what_is_said_of_following(words: str, left: str, leave: dict[str, float]) -> None:
    assert without_follow(words, "t1 red car", 0.05) == (left, leave)


@pytest.mark.parametrize(
    "words",
    [
        "don't follow it",
        "follow it to the exit",
        "surround the car and follow the truck",
        "stay with the group",
        "follow it slowly",
        "follow it around the tree",
        "follow it for ever so long",
        "surround the coin with 6 robots",
        "stop following it",
    ],
)
def test_what_is_not_understood_of_following_is_left_to_be_asked_about(words: str) -> None:
    assert without_follow(words, "t1 red car", None) == (words, None)


def test_without_a_plan_there_is_nothing_to_follow_and_without_a_scale_no_metres() -> None:
    assert without_follow("follow it", "", None) == ("follow it", None)
    assert without_follow("follow it at 1 m/s", "t1 coin", None)[1] is None


def test_long_lines_are_read_in_time_that_grows_with_them() -> None:
    for part in (",", "and then ", "follow it for a ", "a-b ", " "):
        without_follow(f"follow it {part * 9_000}x", "t1", None)


def settings(folder: Path, *, moves: bool) -> Settings:
    path = folder / "slow.yaml"
    path.write_text(SLOW, encoding="utf-8")
    return Settings(fleet=str(path), may_deploy=moves)


def said(picture: Picture, words: str, settings: Settings) -> Run:
    return Agent().run(picture, words, settings=settings, pointed=[BOX])


def test_a_first_instruction_is_followed_up_by_following(red_box: Picture, tmp_path: Path) -> None:
    words = "Surround it with 5 robots and follow it for 2 seconds"
    run = said(red_box, words, settings(tmp_path, moves=True))
    assert run.report.status == "deployed"
    assert "They followed t1 for 2.0 s, until it was 8.0 px from where" in run.report.message
    follow = run.report.arrival and run.report.arrival.follow
    assert follow is not None
    assert (follow.ended, follow.seconds, follow.certified) == ("time", 2.0, 1.0)


def test_a_plan_that_stands_is_followed_with_and_nothing_is_left_out(
    red_box: Picture, tmp_path: Path
) -> None:
    plan_only = settings(tmp_path, moves=False)
    planned = said(red_box, "Surround it with 5 robots and follow it", plan_only)
    assert planned.report.status == "planned"
    assert planned.report.message.endswith(
        'Nothing is followed yet: say "follow it" when the robots may move.'
    )
    moving = Agent().say(
        planned, "follow it for 1 s", settings=plan_only.model_copy(update={"may_deploy": True})
    )
    assert moving.report.status == "deployed"
    assert "They followed t1 for 1.0 s" in moving.report.message
    out = Agent().say(moving, "a bit further out and follow it", settings=plan_only)
    assert out.report.status == "planned"
    assert "Nothing is followed yet" in out.report.message


def test_a_bound_that_was_left_is_how_the_turn_ends(red_box: Picture, tmp_path: Path) -> None:
    words = "Surround it with 5 robots and follow it at no more than 2 px/s"
    run = said(red_box, words, settings(tmp_path, moves=True))
    assert run.report.status == "failed"
    assert "no more than 2 px/s were allowed. All robots hold." in run.report.message


def test_what_no_fleet_sees_moves_nobody(red_box: Picture) -> None:
    run = said(red_box, "Surround it with 5 robots and follow it", Settings())
    assert "does not see where t1 is" in run.report.message
    assert run.report.arrival is None
