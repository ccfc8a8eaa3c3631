"""Four instructions on pictures that ship with formup, run as a person would type them."""

import shlex
from collections.abc import Callable
from pathlib import Path

from .terminal import say

PACKAGE = Path(__file__).parent.parent
PHOTOS = PACKAGE / "evals" / "photos" / "images"
LOT = PACKAGE / "docs" / "images" / "lot.jpg"
RUNS: dict[str, tuple[Path, str]] = {
    "car": (PHOTOS / "cars_two.jpg", '"Surround the red car at the corners" -n 4 --point 390,260'),
    "pool": (
        PHOTOS / "ucm_sparseresidential28.jpg",
        '"Fill the pool with 6 robots" --box 322,261,429,388',
    ),
    "coin": (PHOTOS / "us_coins.jpg", '"Cage the largest coin" -n 10'),
    "lot": (LOT, '"Surround the incorrectly parked car" -n 6'),
}
"""A picture and what is said about it, by the folder that holds what came of it."""


def show_demo(run: Callable[[list[str]], int], out: Path) -> int:
    """Run every instruction of the demonstration.

    Args:
        run: the command line; it takes arguments and returns an exit code.
        out: the folder for pictures, films and plans.

    Returns:
        The worst exit code.
    """
    codes: list[int] = []
    for number, (name, (picture, words)) in enumerate(RUNS.items()):
        arguments = [str(picture), *shlex.split(words), "--out", str(out / name)]
        say(("\n" if number else "") + f"$ formup run {shlex.join(arguments)}")
        codes.append(run(["run", *arguments]))
    return max(codes)
