"""A patrol on a satellite picture, in metres: robots stand round the pool, then round the house.

python examples/patrol.py [PICTURE.jpg]
"""

import sys
from io import BytesIO
from pathlib import Path

from formup import Agent, Run, Settings, TargetPrompt, load_picture
from PIL import Image

PHOTO = Path(__file__).parents[1] / "evals/photos/images/ucm_sparseresidential28.jpg"
SCALE = 0.1016  # metres per pixel: a third of a foot
ROBOTS = 8
POOL = [
    (323, 345),
    (335, 312),
    (362, 277),
    (410, 263),
    (427, 278),
    (408, 325),
    (361, 386),
    (325, 370),
]
HOUSE = [(535, 241), (628, 291), (522, 462), (431, 395), (470, 330), (482, 320)]
CARS_AND_TREE = [(415, 445, 445, 495), (395, 515, 428, 570), (615, 296, 672, 360)]
STOPS = {"pool": (POOL, "1.5 m"), "house": (HOUSE, "2 m")}
"""In order: a rough outline of the thing, in pixels, and how far from it robots stand."""


def sheet(stops: list[Run]) -> Image.Image:
    """The plans beside each other."""
    views = [Image.open(BytesIO(view)) for stop in stops if (view := stop.view())]
    views = [view.resize((view.width * 2 // 3, view.height * 2 // 3)) for view in views]
    beside = Image.new("RGB", (sum(view.width for view in views), views[0].height))
    for number, view in enumerate(views):
        beside.paste(view, (number * views[0].width, 0))
    return beside


def main(picture: str = "patrol.jpg") -> None:
    """Drive to each stop and say how far from the thing robots stand; draw the stops."""
    keep_out = [TargetPrompt(box=box) for box in CARS_AND_TREE]
    keep_out.append(TargetPrompt(outline=tuple(HOUSE)))
    scale = Settings(metres_per_pixel=SCALE)
    session = Agent().start(load_picture(PHOTO), keep_out=keep_out, settings=scale)
    stops: list[Run] = []
    for name, (outline, distance) in STOPS.items():
        words = f"Surround the {name} with {ROBOTS} robots, {distance} from it, robots 50 cm wide"
        planned = session.say(words, pointed=[TargetPrompt(outline=tuple(outline))])
        stops.append(session.say("go") if planned.report.status == "planned" else planned)
        report = stops[-1].report
        if report.status != "deployed":
            sys.exit(f"{name}: {report.status}: {report.message}")
        measures = (report.metric or {})["measures"]
        near, far = measures["min_clearance_m"], measures["max_clearance_m"]
        print(f"{name}: {ROBOTS} robots, {near:.2f} to {far:.2f} m from it")  # noqa: T201
    sheet(stops).save(picture, quality=80)


if __name__ == "__main__":
    main(*sys.argv[1:])
