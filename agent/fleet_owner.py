"""One process at a time has a real fleet, and all its conversations the same one."""

from contextlib import ExitStack

from ..tools.fleet.protocol import Fleet, FleetBusyError
from .conversation import stop_all
from .store.protocol import Store


class FleetOwner:
    """The real fleets of a process, each with a lock in the store that ends with the process."""

    def __init__(self, store: Store) -> None:
        self._store, self._locks = store, ExitStack()
        self._fleets: dict[str, Fleet] = {}

    async def claim(self, fleet: Fleet) -> Fleet:
        """The fleet to use in place of one that was opened: the one there is, if it is real.

        Raises:
            FleetBusyError: another process has it.
        """
        if not fleet.real:
            return fleet
        if fleet.name not in self._fleets:
            lock = self._store.lock(f"fleet.{fleet.name}")
            if lock is None:
                who = self._store.holder(f"fleet.{fleet.name}") or "another process"
                await fleet.close()
                raise FleetBusyError(
                    f"The fleet {fleet.name} is used by {who}: use it there, or end that."
                )
            self._locks.push(lock)
            self._fleets[fleet.name] = fleet
        elif self._fleets[fleet.name] is not fleet:
            await fleet.close()
        return self._fleets[fleet.name]

    async def hold(self) -> None:
        """Hold all robots, whoever drives them."""
        await stop_all(self._fleets.values())

    async def close(self) -> None:
        """Hold the robots and let go of them."""
        for fleet in self._fleets.values():
            await fleet.close()
        self._fleets.clear()
        self._locks.close()
