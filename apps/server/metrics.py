"""The metrics of a server, for Prometheus; they contain no words and no names of people."""

import asyncio
import logging
import time
from typing import Any

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector

from ...agent.turns import Turn

SECONDS = (0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30, 100)


LOG = logging.getLogger("formup.server")


class Metrics:
    """Counts and times of a server.

    Attributes:
        turns: number of turns, by their status.
        seconds: duration of a turn, from its words to its end.
        streams: number of open event streams.
        refused: number of requests refused, by HTTP status.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        ProcessCollector(registry=self.registry)  # CPU and memory, where the system has them
        here, by = self.registry, ["status"]
        self.turns = Counter("formup_turns", "Turns by status.", by, registry=here)
        self.seconds = Histogram(
            "formup_turn_seconds", "Duration of a turn.", buckets=SECONDS, registry=here
        )
        self.streams = Gauge("formup_event_streams", "Open event streams.", registry=here)
        self.refused = Counter(
            "formup_requests_refused", "Refused requests by HTTP status.", by, registry=here
        )

    def answered(self, status: int) -> None:
        """Count a response if it refuses a request; status 0 is a later part of a response."""
        if status >= 400:
            self.refused.labels(status).inc()

    def turn_ended(self, turn: Turn) -> None:
        """Count a turn at its end, and log it."""
        task: asyncio.Task[Any] = turn.task
        failed = task.cancelled() or task.exception() is not None
        status = "refused" if failed else task.result().report.status
        seconds = time.monotonic() - turn.since
        self.turns.labels(status).inc()
        self.seconds.observe(seconds)
        facts = {"by": turn.asked.by, "status": status, "seconds": round(seconds, 3)}
        LOG.info("turn", extra={"facts": facts})
