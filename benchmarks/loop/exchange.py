"""The task of every framework: to call one tool until the scripted server is satisfied."""

from collections.abc import Iterable

SYSTEM = "You are a careful geometry assistant. Use check_points until all the points are checked."
USER = "Please check all the points of the survey and tell me when you are done."
FINAL = "All points were checked."
DESCRIPTION = "Count the points that lie inside the unit circle."


def compute(points: Iterable[tuple[float, float]]) -> str:
    """Return the tool's text: how many (x, y) are in the unit circle, the sum of squared radii."""
    squares = [x * x + y * y for x, y in points]
    inside = sum(square <= 1.0 for square in squares)
    return f"{inside} inside, sum of squares {sum(squares):.3f}"
