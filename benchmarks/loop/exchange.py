"""What every framework is asked to do: call one tool until the scripted server is satisfied."""

from collections.abc import Iterable

SYSTEM = "You are a careful geometry assistant. Use check_points until all the points are checked."
USER = "Please check all the points of the survey and tell me when you are done."
FINAL = "All points were checked."
DESCRIPTION = "Count the points that lie inside the unit circle."


def compute(points: Iterable[tuple[float, float]]) -> str:
    """The tool: how many (x, y) lie in the unit circle, and the sum of their squared radii."""
    squares = [x * x + y * y for x, y in points]
    inside = sum(square <= 1.0 for square in squares)
    return f"{inside} inside, sum of squares {sum(squares):.3f}"
