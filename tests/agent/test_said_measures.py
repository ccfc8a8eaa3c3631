"""What a person gives in words where a front end has no other way: a scale, a point, a box."""

from pathlib import Path

import pytest
from formup.agent.agent import Agent
from formup.agent.conversation import Session
from formup.agent.said_measures import place_said, scale_said
from formup.agent.session import load_run
from formup.agent.store.folder_store import FolderStore
from formup.tools.perception.image import load_picture

PHOTO = Path(__file__).parents[2] / "evals/photos/images/us_coins.jpg"


@pytest.mark.parametrize(
    ("words", "scale"),
    [
        ("the picture is 4 m wide", 0.01),
        ("The image is 90 cm high.", 0.003),
        ("1 px is 5 mm", 0.005),
        ("0.5 cm per pixel", 0.005),
        ("the picture is 0 m wide", None),
        ("the picture is 4 m wide, and cage the coin", None),
        ("1 px is enough", None),
        ("4 m wide", None),
    ],
)
def test_a_scale_in_words(words: str, scale: float | None) -> None:
    assert scale_said(words, (400, 300)) == (scale and pytest.approx(scale))


def test_a_place_in_words() -> None:
    point, box = place_said("the thing at 320, 240"), place_said("the one between 9, 8 and 1,2.")
    assert point is not None
    assert point.points == ((320, 240),)
    assert box is not None
    assert box.box == (1, 2, 9, 8)
    assert place_said("put 5 robots at 320, 240") is None


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return Agent().start(load_picture(PHOTO), stored=FolderStore(tmp_path).create())


def test_a_scale_answers_what_cannot_be_measured_and_is_told_back(session: Session) -> None:
    asked = session.say("Surround the largest coin with 6 robots, 1 cm from it").report
    assert asked.status == "question"
    width = session.picture.size[0]
    done = session.say("the picture is 20 cm wide").report
    assert done.message.startswith(f"1 px is {200 / width:.4g} mm, so the picture is 0.2 m wide")
    assert (done.status, len(done.positions or ())) == ("planned", 6)
    assert done.metric is not None
    assert done.metric["metres_per_pixel"] == pytest.approx(0.2 / width)


def test_a_scale_voids_the_plan_and_is_kept(session: Session) -> None:
    session.say("Surround the largest coin with 6 robots")
    told = session.say("1 px is 0.5 mm").report
    assert told.message.startswith("1 px is 0.5 mm, so the picture is ")
    assert told.message.endswith("Plans made before are void; say again what to do.")
    assert session.run is not None
    assert session.run.stored is not None
    assert load_run(session.run.stored).world.metres_per_pixel == pytest.approx(0.0005)
    again = session.say("Surround the largest coin with 6 robots, 1 cm from it").report
    assert again.status == "planned"


@pytest.mark.parametrize("words", ["the thing at 246, 97", "the one between 175, 30 and 314, 160"])
def test_a_place_answers_which_one_is_meant(session: Session, words: str) -> None:
    assert session.say("Surround the coin with 6 robots").report.status == "question"
    done = session.say(words).report
    assert done.status == "planned"
    assert "pointed at" in done.message
    x0, y0, x1, y1 = done.targets[0]["box"]
    assert x0 < 246 < x1
    assert y0 < 97 < y1
