"""The tool with typed arguments, for the frameworks that read them from a function."""

from exchange import compute
from pydantic import BaseModel


class Point(BaseModel):
    """One of them."""

    label: str
    x: float
    y: float


async def check_points(points: list[Point]) -> str:
    """Count the points that lie inside the unit circle."""
    return compute((p.x, p.y) for p in points)
