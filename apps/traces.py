"""`formup trace FILE`: a run as it went, for reading."""

from . import options as o


def show_trace(file: o.TraceFile) -> None:
    """Show a run step by step: times, tokens, cost, pictures."""
    raise NotImplementedError
