"""Where trials run: here, in a pool of processes, or on a Ray cluster, behind one protocol.

All three call `attempt`, so a row is the same wherever it was made, except for times and host.
"""

import multiprocessing
import os
import platform
import threading
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from typing import Any, Protocol

from ...tools.errors import FleetError, FormupError, InputError, ModelError
from .trials import Trial, TrialRow

Work = Callable[[Trial], TrialRow]
"""Runs and grades a trial; picklable where another process calls it."""
PER_WORKER = 2
"""Trials submitted at once for each worker, so that none waits for the next."""


class Executor(Protocol):
    """Runs trials that are submitted, `capacity` at once.

    Attributes:
        capacity: known after `start`.
    """

    capacity: int

    def start(self, work: Work) -> None:
        """Get ready to call `work`."""
        ...

    def submit(self, trial: Trial) -> None:
        """Accept a trial."""
        ...

    def collect(self) -> list[TrialRow]:
        """Return the rows that are done; wait for the first."""
        ...

    def close(self) -> None:
        """Release everything; trials that have not begun are dropped."""
        ...


def attempt(work: Work, trial: Trial) -> TrialRow:
    """Run a trial; failures of providers, robots or the network give an infrastructure error.

    Any other exception is a bug and ends the run.

    Raises:
        ValueError: the row is of another trial.
    """
    began = time.perf_counter()
    try:
        row = work(trial)
    except (ModelError, FleetError, OSError) as error:
        row = TrialRow.of(trial, "infra_error", feedback=f"{type(error).__name__}: {error}")
    if row.key != trial.key:
        raise ValueError(f"The row for task {trial.task}, trial {trial.trial} is another trial's.")
    seconds = round(time.perf_counter() - began, 3)
    return row.model_copy(update={"seconds": seconds, "host": platform.node()})


class Serial:
    """One trial after the other, in this process."""

    capacity = 1

    def start(self, work: Work) -> None:
        """Get ready."""
        self._work, self._waiting = work, list[Trial]()

    def submit(self, trial: Trial) -> None:
        """Accept a trial."""
        self._waiting.append(trial)

    def collect(self) -> list[TrialRow]:
        """Run what was submitted."""
        waiting, self._waiting = self._waiting, []
        return [attempt(self._work, trial) for trial in waiting]

    def close(self) -> None:
        """Do nothing, as nothing is held."""


class Pool:
    """Processes of this machine, started afresh: for work that computes, such as vision.

    Args:
        workers: number of processes; by default one for each processor.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._workers = workers or os.cpu_count() or 1
        self.capacity = self._workers * PER_WORKER

    def start(self, work: Work) -> None:
        """Get ready; the processes start with the first trials."""
        self._pool = ProcessPoolExecutor(
            self._workers,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_begin_worker,
            initargs=(work,),
        )
        self._running = set[Future[TrialRow]]()

    def submit(self, trial: Trial) -> None:
        """Hand a trial to the pool.

        Raises:
            FormupError: a process of the pool died.
        """
        try:
            self._running.add(self._pool.submit(_attempt_in_worker, trial))
        except BrokenProcessPool:
            raise _pool_died_error() from None

    def collect(self) -> list[TrialRow]:
        """Return the rows that are done; wait for the first.

        Raises:
            FormupError: a process of the pool died.
        """
        done, self._running = wait(self._running, return_when=FIRST_COMPLETED)
        try:
            return [future.result() for future in done]
        except BrokenProcessPool:
            raise _pool_died_error() from None

    def close(self) -> None:
        """Stop the processes after the trials they are at."""
        self._pool.shutdown(cancel_futures=True)


class Ray:
    """Workers of a Ray cluster; formup must be installed on its machines.

    Args:
        address: of the cluster, as ray.init takes it; None starts one on this machine.
        workers: trials at once; by default as many as the cluster has processors.
    """

    capacity = 0

    def __init__(self, address: str | None = None, workers: int | None = None) -> None:
        self._address, self._workers = address, workers

    def start(self, work: Work) -> None:
        """Connect.

        Raises:
            InputError: Ray is not installed.
        """
        try:
            self._ray: Any = import_module("ray")
        except ImportError:
            raise InputError("Running on Ray needs the extra: pip install 'formup[ray]'.") from None
        self._ray.init(
            address=self._address,
            num_cpus=None if self._address else self._workers,
            include_dashboard=None if self._address else False,
            log_to_driver=False,
        )
        workers = self._workers or int(self._ray.cluster_resources().get("CPU", 1))
        self.capacity = workers * PER_WORKER
        self._attempt, self._work = self._ray.remote(attempt), self._ray.put(work)
        self._running = list[Any]()

    def submit(self, trial: Trial) -> None:
        """Hand a trial to the cluster."""
        self._running.append(self._attempt.remote(self._work, trial))

    def collect(self) -> list[TrialRow]:
        """Return the rows that are done; wait for the first."""
        done, self._running = self._ray.wait(self._running, num_returns=1, fetch_local=True)
        return list(self._ray.get(done))

    def close(self) -> None:
        """Disconnect; a cluster that was started here is stopped."""
        self._ray.shutdown()


def executor(name: str, workers: int | None = None) -> Executor:
    """Return the executor of this name: serial, pool or ray.

    Raises:
        InputError: there is none of that name.
    """
    if name == "serial":
        return Serial()
    if name == "pool":
        return Pool(workers)
    if name == "ray":
        return Ray(workers=workers)
    raise InputError(f"Unknown executor {name!r}. There are: serial, pool, ray.")


_worker: list[Work] = []
"""What a process of the pool calls; empty in others."""


def _begin_worker(work: Work) -> None:
    _worker[:] = [work]
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End with the parent: a killed runner must not leave processes behind that wait for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _attempt_in_worker(trial: Trial) -> TrialRow:
    return attempt(_worker[0], trial)


def _pool_died_error() -> FormupError:
    return FormupError(
        "A process of the pool died, perhaps for want of memory. What was done is kept; run again "
        "to go on, with fewer workers."
    )
