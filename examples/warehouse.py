"""Six vehicles in a warehouse, over MQTT: they stand at one pallet, then at the next.

python examples/warehouse.py [FLEET.yaml] [PICTURE.jpg]

Each plan is driven at the person's yes alone.
"""

import sys
from io import BytesIO
from pathlib import Path

from formup import Agent, FormupError, Picture, Run, Settings, picture_from_bytes
from PIL import Image, ImageDraw

FLEET = Path(__file__).parent / "warehouse.yaml"
SIZE, SCALE = (900, 506), 0.05  # px, and metres per pixel, as the fleet's file has it
FLOOR, RACK, EDGE = (190, 191, 188), (128, 122, 112), (96, 90, 82)
RACKS = [(60, 20), (260, 20), (460, 20), (660, 20), (460, 426), (660, 426)]  # upper left corners
PALLETS = {"red": (300, 235, (196, 52, 44)), "blue": (620, 255, (30, 84, 200))}


def hall() -> Picture:
    """The floor from above: racks along the walls, two pallets between them."""
    image = Image.new("RGB", SIZE, FLOOR)
    draw = ImageDraw.Draw(image)
    for x, y in RACKS:
        draw.rectangle((x, y, x + 180, y + 60), RACK, EDGE, 3)
    for x, y, colour in PALLETS.values():
        draw.rectangle((x - 28, y - 20, x + 28, y + 20), colour)
    file = BytesIO()
    image.save(file, "PNG")
    return picture_from_bytes(file.getvalue(), "hall.png")


def sheet(stops: list[Run]) -> Image.Image:
    """The plans below each other."""
    views = [Image.open(BytesIO(view)) for stop in stops if (view := stop.view())]
    below = Image.new("RGB", (views[0].width, sum(view.height for view in views)))
    for number, view in enumerate(views):
        below.paste(view, (0, number * views[0].height))
    return below


def main(fleet: str = str(FLEET), picture: str = "warehouse.jpg") -> None:
    """Plan for each pallet, ask, drive there, and say how near the vehicles were seen."""
    settings = Settings(fleet=fleet, metres_per_pixel=SCALE)
    session = Agent().start(hall(), settings=settings)
    stops: list[Run] = []
    for colour in PALLETS:
        planned = session.say(f"Surround the {colour} pallet with 6 robots, 2 m from it")
        if planned.report.status == "planned":
            print(planned.report.message)  # noqa: T201
            session.say("go")  # waits, as these vehicles count as real
            planned = session.say(input(f"Drive to the {colour} pallet? "))
        report = planned.report
        if report.status != "deployed":
            sys.exit(f"{colour}: {report.status}: {report.message}")
        off = max((report.metric or {})["residual"])
        print(f"{colour}: arrived, at most {off:.3f} m off")  # noqa: T201
        stops.append(planned)
    sheet(stops).save(picture, quality=80)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except FormupError as problem:
        sys.exit(str(problem))
