"""Conversations: turns change the plan that stands, go moves robots, stop holds them."""

import asyncio
import re
from collections.abc import AsyncGenerator
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.conversation import Session
from formup.agent.messages import Call, Reply
from formup.agent.outcomes import Cancelled
from formup.agent.service import Service
from formup.agent.session import Run, load_run
from formup.agent.store.folder_store import FolderStore
from formup.agent.wrappers.doubles import FunctionModel
from formup.tools.context import Settings
from formup.tools.errors import InputError
from formup.tools.fleet.protocol import Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt
from PIL import Image

RED, BLUE = (150, 130, 220, 190), (380, 150, 440, 210)


@pytest.fixture(scope="module")
def picture() -> Picture:
    pixels = np.full((340, 560, 3), 60, np.uint8)
    pixels[135:185, 155:215] = (200, 40, 40)
    pixels[155:205, 385:435] = (40, 60, 210)
    return picture_from_array(pixels)


@pytest.fixture
def session(picture: Picture) -> Session:
    """Eight robots around the red thing; nobody has moved."""
    made = Agent().start(picture, pointed=[TargetPrompt(box=RED)], settings=Settings(robots=8))
    assert made.say("Surround it").report.status == "planned"
    return made


def test_a_small_picture_shows_the_plan_that_stands(session: Session, picture: Picture) -> None:
    assert session.run is not None
    seen = Image.open(BytesIO(session.run.view() or b""))
    assert (seen.format, max(seen.size) < 1100) == ("JPEG", True)
    other = session.image(picture_from_array(picture.pixels[::-1]))
    assert other.view() is None, "its plans are void"


def distance(run: Run) -> float:
    verdict = run.report.verdict
    assert verdict is not None
    return float(verdict.measures["min_clearance_px"])


def test_robots_move_at_go_and_not_before(session: Session, drives: list[Motion]) -> None:
    before = session.run
    assert before is not None
    further = session.say("a bit further out")
    assert further.report.status == "planned"
    assert further.report.parent == before.report.plan_id
    assert distance(further) == pytest.approx(1.25 * distance(before), rel=0.05)
    assert not drives
    went = session.say("go")
    assert went.report.status == "deployed"
    assert drives
    assert went.report.plan_id == further.report.plan_id
    closer = session.say("closer again")
    assert closer.report.status == "planned", "go holds for its turn"


def test_at_once_where_a_person_wants_that_but_not_while_held(picture: Picture) -> None:
    auto = Agent().start(
        picture, pointed=[TargetPrompt(box=RED)], settings=Settings(robots=6), auto=True
    )
    assert auto.say("Surround it").report.status == "deployed"
    assert auto.say("don't move yet").report.status == "answered"
    assert auto.say("a bit further out").report.status == "planned"
    assert auto.say("go").report.status == "deployed"
    assert auto.say("closer").report.status == "deployed"


def test_undo_redo_and_edits_are_turns_that_ask_no_model(session: Session) -> None:
    first = session.run
    assert first is not None
    asked: list[int] = []

    def model(request: object) -> Reply:
        asked.append(1)
        return Reply(text="?")

    session.agent = Agent(FunctionModel(model))
    second = session.edit({"kind": "rotate", "degrees": 10})
    assert second.report.parent == first.report.plan_id
    back = session.undo()
    assert back.report.status == "planned"
    assert (back.report.plan_id, back.report.positions) == (
        first.report.plan_id,
        first.report.positions,
    )
    assert "do not move back" in back.report.message
    again = session.undo(-1)
    assert again.report.plan_id == second.report.plan_id
    assert session.undo(to="first").report.plan_id == first.report.plan_id
    nothing = session.undo(steps=4)
    assert nothing.report.plan_id == first.report.plan_id
    assert "nothing to undo" in nothing.report.message
    assert session.go().report.status == "deployed"
    assert asked == []


def test_a_new_plan_after_going_back_takes_the_place_of_what_was_undone(session: Session) -> None:
    first = session.run
    assert first is not None
    session.edit({"kind": "out", "px": 5})
    session.undo()
    third = session.edit({"kind": "out", "px": 9})
    assert session.undo(-1).report.plan_id == third.report.plan_id
    assert session.undo().report.plan_id == first.report.plan_id


def test_a_fork_leaves_the_other_as_it_was(session: Session) -> None:
    other = session.fork()
    changed = other.say("a bit further out")
    assert session.run is not None
    assert session.run.report.plan_id == changed.report.parent
    assert session.say("turn it 20 degrees").report.parent == changed.report.parent


@pytest.mark.parametrize("words", ["cancel", "Never mind.", "oh forget it", "ok, cancel that"])
def test_what_calls_off_a_question_changes_nothing(
    session: Session, picture: Picture, words: str
) -> None:
    plan = session.say("a bit further out").report.plan_id
    for turn in ("more robots", "how far is robot 4?", "move it 900 px to the left"):
        asked = session.say(turn)
        assert asked.report.status in ("question", "answered", "impossible")
        dropped = session.say(words)
        assert (dropped.report.status, dropped.report.plan_id) == ("answered", plan)
        assert "nothing was changed" in dropped.report.message.lower()
    assert session.say("closer").report.plan_id != plan
    assert session.say(words).report.plan_id == plan, "right after a change it is taken back"
    fresh = Agent().start(picture, pointed=[TargetPrompt(box=RED)])
    assert fresh.say("Surround it").report.status == "question"
    assert fresh.say(words).report.status == "answered"
    assert fresh.say("Surround it with 8 robots").report.status == "planned"


def test_thanks_never_stand_for_the_command_beside_them(session: Session) -> None:
    inside = session.say("thank you, a bit further out please")
    assert inside.report.status == "planned"
    again = session.say("lovely. all of them around it")
    assert "welcome" not in again.report.message
    session.undo(to="first")
    session.undo()
    told = session.say("thank you, go")
    assert told.report.status == "answered"
    assert "No plan stands" in told.report.message


def test_what_is_pointed_at_answers_which(session: Session) -> None:
    moved = session.say("the same around this one", pointed=[TargetPrompt(box=BLUE)])
    assert moved.report.status == "planned"
    assert moved.report.contract is not None
    assert moved.report.contract.groups[0].targets == ("t2",)
    assert moved.report.robots == tuple(str(i) for i in range(1, 9))


@pytest.mark.parametrize(
    ("words", "relation", "robots"),
    [
        ("9 robots around it", "around", 9),
        ("5 robots around it", "around", 5),
        ("line up four robots along it", "along", 4),
        ("put 3 robots to the left of it", "along", 3),
        ("4 robots at its corners", "corners", 4),
    ],
)
def test_later_words_are_about_what_is_pointed_at_with_them(
    session: Session, words: str, relation: str, robots: int
) -> None:
    report = session.say(words, pointed=[TargetPrompt(id="t2", box=BLUE)]).report
    assert report.contract is not None
    (group,) = [group for group in report.contract.groups if group.targets == ("t2",)]
    assert (group.relation, group.robots) == (relation, robots)


def test_what_is_pointed_at_is_never_left_out(session: Session) -> None:
    assert session.run is not None
    before = session.run.world.current
    told = session.say("a bit further out", pointed=[TargetPrompt(id="t2", box=BLUE)])
    assert "does not say what to do about what was pointed at" in told.report.message
    assert told.world.current == before
    moved = session.say("a bit further out")
    assert moved.report.status == "planned" and moved.world.current != before


def test_a_number_of_robots_is_no_length(session: Session) -> None:
    report = session.say("put 5 robots to the left of it").report
    assert report.contract is not None
    (group,) = report.contract.groups
    assert (group.relation, group.side, group.robots) == ("along", "left", 5)


def test_what_is_kept_off_with_the_first_words_is(picture: Picture) -> None:
    made = Agent().start(picture, pointed=[TargetPrompt(box=RED)], settings=Settings(robots=8))
    run = made.say("Surround it", keep_out=[TargetPrompt(id="t2", box=BLUE)])
    assert run.report.contract is not None
    assert run.report.contract.keep_out == ("k1",)


def test_it_works_inside_a_running_event_loop(session: Session) -> None:
    async def notebook() -> Run:
        return session.say("a bit further out")

    shown = asyncio.run(notebook())
    assert shown.report.status == "planned"
    png = getattr(shown, "_repr_png_")()  # noqa: B009
    assert png.startswith(b"\x89PNG")
    assert repr(shown) == f"Run('planned', plan_id={shown.report.plan_id!r})"


def test_commands_before_anything_was_said_are_refused(picture: Picture) -> None:
    empty = Agent().start(picture)
    for command in (empty.undo, empty.go):
        with pytest.raises(InputError, match="Say what to do first"):
            command()


def test_stop_holds_the_robots_until_go_with_the_model_unreachable(
    session: Session, drives: list[Motion]
) -> None:
    session.agent = Agent("openai:nobody", base_url="http://127.0.0.1:9/v1")
    held = session.say("Stop!")
    assert "held" in held.report.message
    session.agent = Agent()
    assert session.say("a bit further out").report.status == "planned"
    assert not drives
    assert session.say("go").report.status == "deployed"


def test_another_picture_voids_the_plan_and_things_are_looked_for_where_they_were(
    picture: Picture, tmp_path: Path
) -> None:
    stored = FolderStore(tmp_path).create()
    session = Agent().start(
        picture, pointed=[TargetPrompt(box=RED)], settings=Settings(robots=8), stored=stored
    )
    first = session.say("Surround it")
    moved = picture_from_array(np.roll(picture.pixels, 6, axis=1))
    told = session.image(moved)
    assert told.report.status == "answered"
    assert "void" in told.report.message
    assert session.go().report.status != "deployed"
    session.run = load_run(stored)
    assert session.run.context.picture.sha256 == moved.sha256
    again = session.say("Surround it with 8 robots")
    assert again.report.status == "planned"
    assert again.report.plan_id != first.report.plan_id
    (target,) = again.world.targets
    assert target.id == "t1"
    assert target.box[0] == pytest.approx(first.world.targets[0].box[0] + 6, abs=2)


class TestService:
    """Many conversations, one turn at a time in each."""

    def test_a_stored_conversation_goes_on_in_another_process(
        self, picture: Picture, tmp_path: Path
    ) -> None:
        async def talk() -> tuple[str, Run]:
            service = Service(Agent(), FolderStore(tmp_path))
            name = service.open(
                picture, settings=Settings(robots=8), pointed=[TargetPrompt(box=RED)]
            )
            await service.say(name, "Surround it")
            last = await service.say(name, "a bit further out")
            await service.close()
            return name, last

        async def go_on(name: str) -> tuple[Run, Run]:
            service = Service(Agent(), FolderStore(tmp_path))
            service.reopen(name)
            back = await service.undo(name)
            fork = service.fork(name, 1)
            forked = await service.say(fork, "turn it 15 degrees")
            assert len(service.events(name)) > 5
            await service.close()
            return back, forked

        name, last = asyncio.run(talk())
        back, forked = asyncio.run(go_on(name))
        assert back.report.plan_id == last.report.parent
        assert forked.report.parent == back.report.plan_id

    def test_stop_passes_while_a_turn_is_under_way(self, picture: Picture, tmp_path: Path) -> None:
        box = {"id": "t1", "box": RED}
        group = {"relation": "around", "targets": ["t1"], "robots": 6}
        arguments = {"contract": {"groups": [group]}, "targets": [box]}

        class Slow:
            name = "slow"

            async def reply(self, request: object) -> Reply:
                await asyncio.sleep(60)
                return Reply(calls=(Call(id="1", name="propose_formation", arguments=arguments),))

        async def talk() -> tuple[Run, Run | None]:
            service = Service(Agent(Slow()), FolderStore(tmp_path))
            name = service.open(picture)
            turn = service.say(name, "Surround it")
            await asyncio.sleep(0.2)
            with pytest.raises(InputError, match="under way") as busy:
                await service.say(name, "and now?")
            assert busy.value.kind == "busy"
            stopped, again = await asyncio.gather(service.stop(name), service.stop(name))
            assert again is stopped
            return await turn, stopped

        run, stopped = asyncio.run(talk())
        assert isinstance(run.outcome, Cancelled)
        assert stopped is not None
        assert stopped.report.status == "stopped"


@pytest.mark.usefixtures("real")
@pytest.mark.parametrize("how", ["/approve", "yes"])
def test_real_robots_wait_for_the_approval_of_the_plan_that_stands(
    session: Session, drives: list[Motion], how: str
) -> None:
    asked = session.say("go")
    assert asked.report.status == "needs_approval"
    assert not drives
    plan = asked.report.plan_id or ""
    with pytest.raises(InputError, match="p-other cannot be approved: plan p-"):
        asyncio.run(session.aapprove("p-other"))
    done = asyncio.run(session.aapprove(plan)) if how == "/approve" else session.say("yes")
    assert done.report.status == "deployed"
    assert drives
    changed = session.say("a bit further out")
    assert changed.report.status == "planned"
    again = session.say("go")
    assert again.report.status == "needs_approval", "an edited plan needs another approval"
    assert session.say("no").report.status != "deployed"


def test_stop_holds_robots_that_drive_within_one_control_period(
    picture: Picture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[int] = []
    drive = SimulatedFleet.drive

    async def slow(self: SimulatedFleet, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        async for poses in drive(self, motion):
            steps.append(1)
            yield poses
            await asyncio.sleep(0.02)

    monkeypatch.setattr(SimulatedFleet, "drive", slow)

    async def talk() -> tuple[Run, int, Run]:
        service = Service(Agent(), FolderStore(tmp_path))
        name = service.open(picture, settings=Settings(robots=8), pointed=[TargetPrompt(box=RED)])
        await service.say(name, "Surround it")
        turn = service.say(name, "go")
        while len(steps) < 5:
            await asyncio.sleep(0.01)
        stopped = await service.stop(name)
        assert stopped is not None
        ended = await turn
        assert ended.report.status in ("stopped", "failed")
        driven = len(steps)
        await asyncio.sleep(0.1)
        assert len(steps) == driven, "nobody moves on"
        asked = await service.say(name, "are they there?")
        assert re.match(
            r"No: 0 of 8 .*; robot \d is the furthest from its own, ", asked.report.message
        )
        held = await service.say(name, "a bit further out")
        assert len(steps) == driven
        went = await service.say(name, "go")
        await service.close()
        return held, driven, went

    held, driven, went = asyncio.run(talk())
    assert driven <= 5 + 2
    assert held.report.status == "planned"
    assert went.report.status == "deployed"
