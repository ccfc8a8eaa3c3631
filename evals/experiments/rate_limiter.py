"""Limits on how fast requests are sent to a model, as its provider demands.

Each process has its own limit, so a sweep divides what is allowed among its processes.
"""

import asyncio
import time
from functools import lru_cache
from threading import Lock
from typing import Any

from ...agent.messages import Reply
from ...agent.model import Model, Request


class RateLimiter:
    """Turns that are a fixed time apart.

    Args:
        per_minute: turns, above 0.
    """

    def __init__(self, per_minute: float) -> None:
        self._gap = 60 / per_minute
        self._free_at = 0.0
        self._lock = Lock()

    def wait(self, now: float) -> float:
        """Take the next turn; return the seconds until it comes.

        Args:
            now: seconds on a steady clock.
        """
        with self._lock:
            start = max(now, self._free_at)
            self._free_at = start + self._gap
            return start - now


@lru_cache
def rate_limiter(model: str, per_minute: float) -> RateLimiter:
    """Return the rate limiter of a model in this process, the same one for all trials."""
    return RateLimiter(per_minute)


class RateLimited:
    """A model that waits for its turn before each reply; all else is passed on to it."""

    def __init__(self, model: Model, limiter: RateLimiter) -> None:
        self._model, self._limiter = model, limiter

    @property
    def name(self) -> str:
        """Name of the model."""
        return self._model.name

    async def reply(self, request: Request) -> Reply:
        """Wait for a turn, then return the model's reply."""
        await asyncio.sleep(self._limiter.wait(time.monotonic()))
        return await self._model.reply(request)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._model, name)
