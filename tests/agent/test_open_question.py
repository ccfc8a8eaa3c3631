"""A question that is open: robots move on no words before it is settled."""

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.conversation import DROPPED, Session
from formup.agent.messages import Call, Reply, Result
from formup.agent.model import Request
from formup.tools.errors import InputError
from formup.tools.fleet.protocol import Motion
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt


def test_nothing_moves_at_go_while_a_question_is_open(
    drives: list[Motion],
) -> None:
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    red = TargetPrompt(box=(55, 35, 125, 95))
    session = Agent().start(picture_from_array(pixels), pointed=[red])
    session.say("Surround it with 6 robots")
    asked = session.say("keep clear of the flurb")
    assert asked.report.status == "question"
    with pytest.raises(InputError, match="A question is open") as refused:
        session.say("go")
    assert refused.value.kind == "asked"
    assert session.run is asked
    assert not drives
    session.say("never mind")
    session.say("go")
    assert drives


@pytest.fixture
def open_session() -> Session:
    """A first instruction that leaves open how many robots."""
    pixels = np.full((140, 260, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    pixels[50:100, 180:230] = (40, 60, 210)
    session = Agent().start(picture_from_array(pixels))
    assert session.say("surround the red thing").report.status == "question"
    return session


@pytest.mark.parametrize(
    "words",
    ["undo", "take that back", "never mind", "cancel", "start over", "oh, skip the question"],
)
def test_what_calls_a_first_question_off_drops_it(open_session: Session, words: str) -> None:
    report = open_session.say(words).report
    assert (report.status, report.message) == ("answered", DROPPED)


def test_undo_with_nothing_to_take_back_drops_the_question(open_session: Session) -> None:
    open_session.say("5")
    assert open_session.say("keep clear of the flurb").report.status == "question"
    assert open_session.say("undo").report.message == DROPPED


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("help", "Say what the robots should do"),
        ("what can you do?", "Say what the robots should do"),
        ("what do you see?", "Nothing stands yet"),
    ],
)
def test_a_question_or_help_is_answered_and_the_question_stays_open(
    open_session: Session, words: str, told: str
) -> None:
    for _ in range(2):
        report = open_session.say(words).report
        assert report.status == "question"
        assert report.message.startswith(told)
        assert report.message.endswith("How many robots? Say a number, or as many as needed.")
    done = open_session.say("5").report
    assert (done.status, len(done.positions or ())) == ("planned", 5)


class Asking:
    """A language model that asks how many, and takes what comes for the answer."""

    name = "asking"

    def __init__(self) -> None:
        self.heard: list[str] = []

    async def reply(self, request: Request) -> Reply:
        last = request.messages[-1]
        if isinstance(last, Result):
            self.heard.append(last.text)
            return Reply(text="Thank you.")
        asked = {"question": "Which side?", "options": ["the left side", "the right side"]}
        return Reply(calls=(Call(id="q", name="ask_user", arguments=asked),))


def test_help_never_reaches_a_model_as_the_answer() -> None:
    model = Asking()
    session = Agent(model).start(picture_from_array(np.full((90, 120, 3), 60, np.uint8)))
    asked = session.say("six of them")
    for words in ("help", "what can you do?", "help me", "help", "help", "help"):
        report = session.say(words).report
        assert report.status == "question"
        assert report.message.startswith("Say what the robots should do")
        assert report.message.endswith(f" {asked.report.message}")
        assert report.message.count("Say what the robots should do") == 1
        assert report.options == asked.report.options
    assert not model.heard
    done = session.say("2").report
    assert model.heard == ["2"]
    assert (done.message, done.instruction) == ("Thank you.", "six of them (the right side)")


def test_a_title_says_what_was_asked_in_the_end(open_session: Session) -> None:
    open_session.say("what do you see?")
    assert open_session.run is not None
    assert open_session.run.report.instruction == "surround the red thing"
    assert open_session.say("5").report.instruction == "surround the red thing (5)"
    assert open_session.say("a bit further out").report.instruction == "a bit further out"


@pytest.mark.parametrize("before", ["", "forget that, ", "No, instead "])
def test_a_new_instruction_drops_the_question_and_says_so(
    open_session: Session, before: str
) -> None:
    done = open_session.say(f"{before}surround the blue thing with 4 robots").report
    assert (done.status, len(done.positions or ())) == ("planned", 4)
    assert done.message.startswith("The question before is dropped. ")
    assert done.instruction == "surround the blue thing with 4 robots"
    assert [t["label"] for t in done.targets] == ["blue thing"]
    assert "dropped" not in open_session.say("a bit further out").report.message


def test_it_stays_open_while_a_question_about_the_plan_is_answered(open_session: Session) -> None:
    open_session.say("5")
    asked = open_session.say("move the flurb").report
    assert asked.status == "question"
    told = open_session.say("how far is robot 4?").report
    assert told.message.startswith("Robot 4 is ")
    assert told.message.endswith(asked.message)
    assert (told.status, told.plan_id) == ("question", asked.plan_id)
