"""`formup fleet`: look at a fleet before it is driven, or stand in for its robots."""

from pathlib import Path
from typing import Annotated

import typer

from ..tools.fleet.described import mqtt_fleet
from ..tools.fleet.mqtt.checkup import checked
from ..tools.fleet.mqtt.stand_in import StandIns
from .terminal import say

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
File = Annotated[Path, typer.Argument(help="A fleet's YAML file.", show_default=False)]


Seconds = Annotated[float, typer.Option("--seconds", help="To listen for.", min=0.1, max=3600)]


@app.command()
def check(file: File, seconds: Seconds = 3.0) -> None:
    """Say who is there and what is wrong; nothing is moved. Ends with 4 where all is not well."""
    told, fit = checked(mqtt_fleet(file), seconds)
    say("\n".join(told))
    raise typer.Exit(0 if fit else 4)


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
