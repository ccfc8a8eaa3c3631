"""A real broker, for examples whose robots are reached through one."""

from broker import brokers

__all__ = ["brokers"]
