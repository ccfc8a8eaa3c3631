"""One process at a time has a real fleet, and all its conversations the same one."""

import asyncio
from collections.abc import Callable
from contextlib import ExitStack
from urllib.parse import quote

from ..tools.fleet.protocol import Fleet, FleetBusyError
from ..tools.tool import to_its_end
from .conversation import stop_all
from .store.protocol import PROCESS, Store

TRIES, PAUSE = 20, 0.05
"""How often a fleet is asked for that another process opens, and seconds between."""


class FleetOwner:
    """The real fleets of a process, each with a lock in the store that ends with the process."""

    def __init__(self, store: Store) -> None:
        self._store, self._locks = store, ExitStack()
        self._fleets: dict[str, Fleet] = {}
        self._simulated: set[str] = set()

    async def claim(self, name: str, opened: Callable[[], Fleet]) -> Fleet:
        """The fleet of a name: the real one there is, else one that is opened now.

        What is not known to be simulated is opened under its lock: no two drive one hardware. A
        database that was restarted has lost the lock, which is then taken again.

        Raises:
            FleetBusyError: another process has it.
        """
        who, locked = "", f"fleet.{quote(name, safe='')}"  # a file's name has slashes
        for _ in range(TRIES):
            if name in self._simulated:
                return opened()
            who = await to_its_end(lambda: self._store.holder(locked))
            mine = self._fleets.get(name)
            if mine is not None and who == PROCESS:
                return mine
            lock = await to_its_end(lambda: self._store.lock(locked))
            if lock is None and mine is not None and not who:
                return mine  # Windows reads no locked file
            if lock is None:  # perhaps just for as long as a simulated one is opened
                await asyncio.sleep(PAUSE)
                continue
            with lock:
                fleet = mine or opened()
                if fleet.real:
                    self._fleets[name] = fleet
                    self._locks.push(lock.pop_all())
                else:
                    self._simulated.add(name)
            return fleet
        raise FleetBusyError(
            f"The fleet {name} is used by {who or 'another process'}: use it there, or end that."
        )

    async def hold(self) -> None:
        """Hold all robots, whoever drives them."""
        await stop_all(self._fleets.values())

    async def close(self) -> None:
        """Hold the robots and let go of them."""
        for fleet in self._fleets.values():
            await fleet.close()
        self._fleets.clear()
        self._locks.close()
