import asyncio
from collections.abc import AsyncGenerator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.feed import Poses
from formup.agent.service import Service
from formup.agent.session import Run
from formup.agent.store.folder_store import FolderStore
from formup.agent.store.protocol import Event, Store
from formup.agent.turns import Asked
from formup.tools.context import Settings
from formup.tools.errors import FleetError, InputError
from formup.tools.fleet.protocol import Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.perception.image import Picture, picture_from_array, picture_from_bytes
from formup.tools.perception.target_prompt import TargetPrompt

pytestmark = pytest.mark.parametrize("address", ["folder", "sqlite", "postgresql"], indirect=True)
RED = (150.0, 130.0, 220.0, 190.0)


@pytest.fixture(scope="module")
def picture() -> Picture:
    pixels = np.full((340, 560, 3), 60, np.uint8)
    pixels[135:185, 155:215] = (200, 40, 40)
    return picture_from_array(pixels)


@pytest.fixture
def drives(monkeypatch: pytest.MonkeyPatch) -> list[Motion]:
    """The motions that were driven; slowly, so that something can happen meanwhile."""
    begun: list[Motion] = []
    drive = SimulatedFleet.drive

    async def slow(self: SimulatedFleet, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
        begun.append(motion)
        async for poses in drive(self, motion):
            yield poses
            await asyncio.sleep(0.02)

    monkeypatch.setattr(SimulatedFleet, "drive", slow)
    return begun


def opened(service: Service, picture: Picture) -> str:
    return service.open(picture, settings=Settings(robots=6), pointed=[TargetPrompt(box=RED)])


def other(store: Store) -> Service:
    """What another process has; locks of files are not shared within a process either."""
    return Service(Agent(), store)


def test_a_key_asked_twice_is_one_turn(
    store: Store, picture: Picture, drives: list[Motion]
) -> None:
    async def talk() -> None:
        service = Service(Agent(), store)
        name = opened(service, picture)
        await service.say(name, "Surround it")
        asked = Asked(by="ann", key="k1")
        first, again = service.go(name, asked=asked), service.go(name, asked=asked)
        assert again is first, "while it is under way it is that turn"
        with pytest.raises(InputError) as busy:
            service.go(name, "p-1", asked=Asked(key="k2"))
        assert busy.value.kind == "busy"
        await first
        for one in (service, other(store)):
            with pytest.raises(InputError) as repeated:
                await one.go(name, asked=asked)
            assert (repeated.value.kind, repeated.value.facts["turn"]) == ("repeated", first.number)
            with pytest.raises(InputError) as key:
                await one.go(name, "p-1", asked=asked)
            assert key.value.kind == "key"
        assert len({id(m) for m in drives}) == len(drives)
        moved = [e for e in service.events(name) if e.kind == "moving"]
        assert len(moved) == 1
        assert service.events(name)[first.number - 1].data["by"] == "ann"

    asyncio.run(talk())


def test_another_process_takes_the_next_turn(store: Store, picture: Picture) -> None:
    async def talk() -> None:
        here, there = Service(Agent(), store), other(store)
        name = opened(here, picture)
        planned = await there.say(name, "Surround it")
        assert planned.report.status == "planned", "what was pointed at is stored too"
        assert planned.report.positions is not None
        assert len(planned.report.positions) == 6
        changed = await here.say(name, "a bit further out")
        assert changed.report.parent == planned.report.plan_id
        undone = await there.undo(name)
        assert undone.report.plan_id == planned.report.plan_id

    asyncio.run(talk())


def test_a_turn_elsewhere_is_refused_here_and_stopped_from_here(
    store: Store, picture: Picture, drives: list[Motion]
) -> None:
    async def talk() -> Run | None:
        here, there = Service(Agent(), store), other(store)
        name = opened(here, picture)
        await here.say(name, "Surround it")
        turn = here.go(name)
        await turn.moving.wait()
        who = "" if isinstance(store, FolderStore) else r" \(\S+:\d+\)"
        with pytest.raises(InputError, match=f"written by another process{who};") as busy:
            await there.say(name, "and now?")
        assert busy.value.kind == "busy"
        stopped = await there.stop(name)
        ended = await turn
        assert ended.report.status in ("stopped", "failed")
        assert stopped is not None
        assert stopped.report.message.startswith("The robots are held")
        went = await here.go(name)
        assert went.report.status == "deployed"
        return stopped

    asyncio.run(talk())


def test_a_subscriber_misses_nothing_wherever_it_begins(store: Store, picture: Picture) -> None:
    async def talk() -> None:
        service = Service(Agent(), store)
        name = opened(service, picture)

        async def read(after: int, upto: int) -> list[Event]:
            found: list[Event] = []
            async for told in service.follow(name, after):
                if isinstance(told, Event):
                    found.append(told)
                if found and found[-1].number == upto:
                    break
            return found

        early = asyncio.ensure_future(read(0, 12))
        for words in ("Surround it", "further out", "undo", "go"):
            await service.say(name, words)
        numbers = [event.number for event in await early]
        assert numbers == list(range(1, 13))
        last = service.events(name)[-1].number
        for after in range(last):
            found = await read(after, last)
            assert [event.number for event in found] == list(range(after + 1, last + 1))

        elsewhere = asyncio.ensure_future(read(last, last + 3))
        await asyncio.sleep(0)
        await other(store).say(name, "a bit closer")
        assert len(await elsewhere) == 3, "written by another process"

    asyncio.run(talk())


def test_poses_are_the_latest_for_whoever_is_slow(
    store: Store, picture: Picture, drives: list[Motion]
) -> None:
    async def talk() -> list[Poses]:
        service = Service(Agent(), store)
        name = opened(service, picture)
        await service.say(name, "Surround it")
        seen: list[Poses] = []

        async def slowly() -> None:
            async for told in service.follow(name):
                if isinstance(told, Poses):
                    seen.append(told)
                    await asyncio.sleep(0.1)

        reader = asyncio.ensure_future(slowly())
        await service.go(name)
        await asyncio.sleep(0.3)
        reader.cancel()
        return seen

    seen = asyncio.run(talk())
    numbers = [poses.number for poses in seen]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] > 2 * len(numbers), "those between were skipped"


@pytest.fixture
def real(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SimulatedFleet, "real", True)


@pytest.mark.usefixtures("real")
def test_an_approval_is_for_one_plan_once(
    store: Store, picture: Picture, drives: list[Motion]
) -> None:
    async def talk() -> None:
        service, second = Service(Agent(), store), other(store)
        name = opened(service, picture)
        await service.say(name, "Surround it")
        asked = await service.go(name)
        assert asked.report.status == "needs_approval"
        plan = str(asked.report.plan_id)
        waits = await service.waits(name)
        assert waits is not None
        assert waits == await service.waits(name)
        for wrong, nonce in ((plan, ""), (plan, "guess"), ("p-other", waits.nonce)):
            with pytest.raises(InputError) as refused:
                await service.approve(name, wrong, nonce)
            assert refused.value.kind == "approval"
        await service.close()
        done = await second.approve(name, plan, waits.nonce)
        assert done.report.status == "deployed", "any process can check it"
        with pytest.raises(InputError, match="no plan waits"):
            await second.approve(name, plan, waits.nonce)
        await second.say(name, "further out")
        await second.go(name)
        with pytest.raises(InputError):
            await second.approve(name, plan, waits.nonce)
        assert len([e for e in second.events(name) if e.kind == "moving"]) == 1
        await second.close()

    asyncio.run(talk())


def test_who_may_only_plan_moves_nothing(
    store: Store, picture: Picture, drives: list[Motion]
) -> None:
    async def talk() -> None:
        service, asked = Service(Agent(), store, auto=True), Asked(by="eve", may_move=False)
        name = opened(service, picture)
        planned = await service.say(name, "Surround it", asked)
        assert planned.report.status == "planned"
        for words in ("go", None):
            with pytest.raises(InputError) as refused:
                await (service.say(name, words, asked) if words else service.go(name, asked=asked))
            assert refused.value.kind == "not_allowed"
        # Nor does an answer, in a turn begun by somebody who may.
        name = opened(service, picture)
        assert (await service.say(name, "Place robots")).report.status == "question"
        answered = await service.say(name, "around it", asked)
        assert answered.report.status == "planned"

    asyncio.run(talk())
    assert not drives


def test_forgotten_conversations_are_read_again(
    store: Store, picture: Picture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("formup.agent.open_sessions.MOST_OPEN", 2)

    async def talk() -> None:
        service = Service(Agent(), store)
        names = [opened(service, picture) for _ in range(4)]
        plans = [(await service.say(name, "Surround it")).report.plan_id for name in names]
        for name, plan in zip(names, plans, strict=True):
            changed = await service.say(name, "further out")
            assert changed.report.parent == plan

    asyncio.run(talk())


def test_ids_say_whose_a_conversation_is(store: Store, picture: Picture) -> None:
    service = Service(Agent(), store)
    name = service.open(picture, owner="ann")
    assert name.startswith("ann-")
    assert asyncio.run(service.fresh(name)).run is None


def test_a_picture_that_came_as_bytes_is_the_same_when_it_is_read_again(store: Store) -> None:
    photo = Path(__file__).parents[3] / "evals/photos/images/us_coins.jpg"
    sent = picture_from_bytes(photo.read_bytes(), "sent")

    async def talk() -> None:
        here, there = Service(Agent(), store), other(store)
        name = here.open(sent, settings=Settings(robots=4))
        assert (await there.fresh(name)).picture.sha256 == sent.sha256
        await here.say(name, "Cage the largest coin")
        assert (await there.fresh(here.fork(name))).picture.sha256 == sent.sha256

    asyncio.run(talk())


@pytest.mark.usefixtures("real")
def test_deleting_a_session_leaves_the_fleet_to_the_others(store: Store, picture: Picture) -> None:
    async def talk() -> None:
        service = Service(Agent(), store)
        names = [opened(service, picture) for _ in range(2)]
        for name in names:
            await service.say(name, "Surround it")
        await service.delete(names[0])
        assert (await service.go(names[1])).report.status == "needs_approval"
        assert (
            await service.say(opened(service, picture), "Surround it")
        ).report.status == "planned"
        await service.close()

    asyncio.run(talk())


def test_stop_passes_while_a_go_begins(
    store: Store, picture: Picture, drives: list[Motion]
) -> None:
    async def talk(delay: float) -> None:
        service = Service(Agent(), store)
        name = opened(service, picture)
        await service.say(name, "Surround it")
        stops = [asyncio.ensure_future(service.stop(name)) for _ in range(2)]
        await asyncio.sleep(delay)
        with suppress(InputError, asyncio.CancelledError):  # a stop is a turn too, or cuts it off
            await service.go(name)
        stopped = await asyncio.gather(*stops)
        assert all(run is not None for run in stopped)
        held = service.session(name).run
        assert held is not None
        assert held.report.arrival is None or not held.report.arrival.arrived
        await service.close()

    for delay in (0.0, 0.0005, 0.001, 0.002):
        asyncio.run(talk(delay))


@pytest.mark.parametrize("how", ["fails", "hangs"])
def test_a_fleet_that_cannot_be_told_to_stop_does_not_keep_a_turn_going(
    store: Store,
    picture: Picture,
    drives: list[Motion],
    monkeypatch: pytest.MonkeyPatch,
    how: str,
) -> None:
    async def stop(self: SimulatedFleet) -> None:
        if how == "hangs":
            await asyncio.sleep(60)
        raise FleetError("The radio is lost.")

    monkeypatch.setattr("formup.agent.service.HOLDING", 0.1)

    async def talk() -> Run:
        service = Service(Agent(), store)
        name = opened(service, picture)
        await service.say(name, "Surround it")
        turn = service.go(name)
        await turn.moving.wait()
        with monkeypatch.context() as broken:
            broken.setattr(SimulatedFleet, "stop", stop)
            with pytest.raises(FleetError):
                await service.stop(name)
        return await turn

    assert asyncio.run(talk()).report.status in ("stopped", "failed")


def test_a_session_is_not_replaced_under_its_turn(
    store: Store, picture: Picture, drives: list[Motion]
) -> None:
    async def talk() -> None:
        service = Service(Agent(), store)
        name = opened(service, picture)
        await service.say(name, "Surround it")
        turn = service.go(name)
        seen = [await service.fresh(name) for _ in range(20)]
        await turn
        assert {id(held) for held in seen} == {id(service.session(name))}

    asyncio.run(talk())
