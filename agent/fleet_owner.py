"""Lets one process at a time have a real fleet, shared by all conversations of that process."""

import asyncio
from collections.abc import Callable
from contextlib import ExitStack
from urllib.parse import quote

from ..tools.fleet.protocol import Fleet, FleetBusyError
from ..tools.tool import to_its_end
from .stopping import stop_all
from .store.protocol import PROCESS, Store

TRIES, PAUSE = 20, 0.05
"""How often to try for a fleet that another process is opening, and seconds between tries."""


class FleetOwner:
    """The real fleets of a process, each with a lock in the store that ends with the process."""

    def __init__(self, store: Store) -> None:
        self._store, self._locks = store, ExitStack()
        self._fleets: dict[str, Fleet] = {}
        self._simulated: set[str] = set()

    async def claim(self, name: str, opened: Callable[[], Fleet]) -> Fleet:
        """Return the fleet of a name: the real one that is open, else one that is opened now.

        A fleet that is not known to be simulated is opened under its lock, so that no two processes
        drive the same hardware. A database that was restarted has lost the lock, which is then
        taken again.

        Raises:
            FleetBusyError: another process has it.
        """
        who, locked = "", f"fleet.{quote(name, safe='')}"  # a fleet's name may be a path
        for _ in range(TRIES):
            if name in self._simulated:
                return opened()
            who = await to_its_end(lambda: self._store.holder(locked))
            mine = self._fleets.get(name)
            if mine is not None and who == PROCESS:
                return mine
            lock = await to_its_end(lambda: self._store.lock(locked))
            if lock is None and mine is not None and not who:
                return mine  # the holder is unknown: Windows cannot read a locked file
            if lock is None:  # perhaps only while a simulated fleet is opened
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
        """Close all fleets, which holds their robots, and release the locks."""
        for fleet in self._fleets.values():
            await fleet.close()
        self._fleets.clear()
        self._locks.close()
