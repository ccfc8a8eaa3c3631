"""A real broker, for fleets that are reached through one."""

from collections.abc import Callable

import pytest
from broker import Broker, brokers

__all__ = ["brokers"]


@pytest.fixture(scope="session")
def shared(brokers: Callable[..., Broker]) -> Broker:
    """One broker for all tests that leave it alone; each has topics of its own."""
    return brokers()
