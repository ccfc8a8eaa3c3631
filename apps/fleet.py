"""`formup fleet`: look at a fleet before it is driven, or stand in for its robots."""

from pathlib import Path
from typing import Annotated

import typer

from ..tools.fleet.described import mqtt_fleet
from ..tools.fleet.mqtt.stand_in import StandIns
from .terminal import say

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
File = Annotated[Path, typer.Argument(help="A fleet's YAML file.", show_default=False)]


@app.command()
def simulate(file: File) -> None:
    """Stand in for the robots of a file on the same wire, until Ctrl-C."""
    settings = mqtt_fleet(file)
    robots = StandIns(settings, lambda text: say(f"formup: {text}"))
    say(f"formup: standing in for {len(settings.robots)} robots at {settings.broker}.")
    try:
        robots.run()
    finally:
        robots.close()
