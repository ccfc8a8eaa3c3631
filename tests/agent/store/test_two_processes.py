"""What one process does with a store while another one uses it too."""

import asyncio
from typing import Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.service import Service
from formup.agent.store.places import store_at
from formup.agent.store.protocol import Store
from formup.tools.context import Settings
from formup.tools.errors import InputError
from formup.tools.fleet.simulated import SimulatedFleet
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt
from sqlalchemy import create_engine, text

pytestmark = pytest.mark.parametrize("address", ["folder", "sqlite", "postgresql"], indirect=True)
RED = (150.0, 130.0, 220.0, 190.0)


@pytest.fixture(scope="module")
def picture() -> Picture:
    pixels = np.full((340, 560, 3), 60, np.uint8)
    pixels[135:185, 155:215] = (200, 40, 40)
    return picture_from_array(pixels)


def opened(service: Service, picture: Picture) -> str:
    return service.open(picture, settings=Settings(robots=6), pointed=[TargetPrompt(box=RED)])


@pytest.mark.usefixtures("real")
def test_one_process_has_a_real_fleet(
    store: Store, picture: Picture, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[SimulatedFleet] = []
    begin = SimulatedFleet.__init__

    def counted(self: SimulatedFleet, *given: Any, **named: Any) -> None:
        made.append(self)
        begin(self, *given, **named)

    monkeypatch.setattr(SimulatedFleet, "__init__", counted)

    async def talk() -> None:
        here, there = Service(Agent(), store), Service(Agent(), store)
        first, second = opened(here, picture), opened(here, picture)
        third = opened(there, picture)
        for name in (first, second):
            assert (await here.say(name, "Surround it")).report.status == "planned"
        fleets = [here.session(n).services.fleets["simulated"] for n in (first, second)]  # type: ignore[union-attr]
        assert fleets[0] is fleets[1], "one fleet for all conversations"
        refused = await there.say(third, "Surround it")
        assert refused.report.status == "failed"
        assert "is used by" in refused.report.message
        assert len(made) == 1, "no second one is opened, not even to be closed again"
        await here.close()
        again = opened(there, picture)
        assert (await there.say(again, "Surround it")).report.status == "planned"
        await there.close()

    asyncio.run(talk())


@pytest.mark.usefixtures("real")
def test_a_database_that_is_started_anew_loses_nothing(address: str, picture: Picture) -> None:
    if "postgresql" not in address:
        pytest.skip("files need no server")

    def restarted() -> None:
        """As after a restart: all connections are cut, and with them their locks gone."""
        own = "pid <> pg_backend_pid() AND datname = current_database()"
        engine = create_engine(address)
        with engine.connect() as connection:
            cut = f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE {own}"
            connection.execute(text(cut))
        engine.dispose()

    async def talk() -> None:
        here, there = Service(Agent(), store_at(address)), Service(Agent(), store_at(address))
        name, others = opened(here, picture), opened(there, picture)
        first = await here.say(name, "Surround it")
        restarted()
        second = await here.say(name, "a bit further out")
        assert second.report.parent == first.report.plan_id
        refused = await there.say(others, "Surround it")
        assert "is used by" in refused.report.message, "the fleet's lock is taken again"
        assert (await here.go(name)).report.status == "needs_approval"
        restarted()
        waits = await here.waits(name)
        assert waits is not None
        assert (await here.approve(name, str(waits.plan_id), waits.nonce)).report.arrival
        numbers = [event.number for event in here.events(name)]
        assert numbers == list(range(1, len(numbers) + 1))
        await here.close()
        await there.close()

    asyncio.run(talk())


def test_a_conversation_that_another_process_deleted_is_forgotten(
    store: Store, picture: Picture
) -> None:
    async def talk() -> None:
        here, there = Service(Agent(), store), Service(Agent(), store)
        name = opened(here, picture)
        await here.say(name, "Surround it")
        stream, last = here.follow(name), len(here.events(name))
        while getattr(await anext(stream), "number", 0) < last:
            pass  # it has begun, and waits for what comes next
        following = asyncio.ensure_future(anext(stream, None))
        await there.delete(name)
        assert await following is None, "its stream ends"
        for command in (here.fresh, here.stop, here.waits, here.undo, here.go, here.edit):
            with pytest.raises(InputError) as gone:
                await command(name)
            assert gone.value.kind == "missing"
        with pytest.raises(InputError):
            here.session(name)

    asyncio.run(talk())
