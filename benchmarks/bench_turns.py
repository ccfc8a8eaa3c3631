"""CPU time of an offline turn that edits 30 robots in a picture of 2 megapixels.

It is the time of the whole process, for the first turns and later ones; the time to draw and
encode the picture is printed too.
"""

import time
from collections.abc import Iterator, Sequence
from io import BytesIO
from statistics import median

import numpy as np

from ..agent.agent import Agent
from ..agent.conversation import Session
from ..tools.context import Settings
from ..tools.draw import draw_plan
from ..tools.perception.image import Picture, picture_from_array
from ..tools.perception.target_prompt import TargetPrompt
from .growth import show

SIZE, ROBOTS = (1100, 1840), 30
BOX = (780, 420, 1060, 680)
WORDS = ("a bit further out", "turn it 10 degrees", "a bit closer", "turn it back 10 degrees")
ROUNDS = (1, 10, 50)
"""Rounds of four turns whose median cost is shown."""


def _scene() -> Picture:
    rng = np.random.default_rng(7)
    pixels = rng.integers(85, 105, (*SIZE, 3), dtype=np.uint8)
    x0, y0, x1, y1 = BOX
    pixels[y0 + 10 : y1 - 10, x0 + 10 : x1 - 10] = (190, 40, 40)
    return picture_from_array(pixels)


def main() -> None:
    """Print the CPU time of turns."""
    settings = Settings(robots=ROBOTS)
    session = Agent().start(_scene(), pointed=[TargetPrompt(box=BOX)], settings=settings)
    session.say("Surround it")
    spent: list[float] = []
    for turn in range(4 * max(ROUNDS)):
        began = time.process_time()
        run = session.say(WORDS[turn % len(WORDS)])
        spent.append(1000 * (time.process_time() - began))
        assert run.report.status == "planned", run.report.message
    show(_turn_rows(spent, session))


def _turn_rows(spent: Sequence[float], session: Session) -> Iterator[str]:
    yield f"{ROBOTS} robots, {SIZE[1]} x {SIZE[0]} px; CPU of an edit turn, ms"
    for first in ROUNDS:
        cost = median(spent[4 * (first - 1) : 4 * first])
        yield f"  turn {4 * first - 3:>4} {cost:7.1f}   {cost / median(spent[:4]):.2f} x the first"
    run = session.run
    assert run is not None
    began = time.process_time()
    image = draw_plan(run.context.picture, run.world, run.world.plan().plan, "")
    image.save(BytesIO(), "PNG")
    yield f"  drawing and encoding {1000 * (time.process_time() - began):7.1f}"


if __name__ == "__main__":
    main()
