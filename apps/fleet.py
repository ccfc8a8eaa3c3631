"""`formup fleet`: checks a fleet before it is driven, holds its robots, or stands in for them."""

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from ..tools.fleet.described import described_as, to_be_stopped
from ..tools.fleet.mqtt.checkup import checked as mqtt_checked
from ..tools.fleet.mqtt.fleet import MqttFleet
from ..tools.fleet.mqtt.settings import MqttSettings
from ..tools.fleet.mqtt.stand_in import MqttStandIns
from ..tools.fleet.ros.checkup import checked as ros_checked
from ..tools.fleet.ros.fleet import RosFleet
from ..tools.fleet.ros.settings import RosSettings
from ..tools.fleet.ros.stand_in import RosStandIns
from ..tools.fleet.vda5050.checkup import checked as vda5050_checked
from ..tools.fleet.vda5050.fleet import Vda5050Fleet
from ..tools.fleet.vda5050.settings import Vda5050Settings
from ..tools.fleet.vda5050.stand_in import Vda5050StandIns
from ..tools.fleet.wire.fleet import WireFleet
from ..tools.fleet.wire.settings import WireSettings
from ..tools.fleet.wire.stopping import stopped
from .terminal import say

app = typer.Typer(no_args_is_help=True, rich_markup_mode=None)
File = Annotated[
    Path, typer.Argument(help="YAML file that describes the fleet.", show_default=False)
]
Seconds = Annotated[
    float, typer.Option("--seconds", help="How long to listen, in seconds.", min=0.1, max=3600)
]

CHECKUPS: Mapping[type[WireSettings], Callable[[Any, float], tuple[list[str], bool]]] = {
    MqttSettings: mqtt_checked,
    RosSettings: ros_checked,
    Vda5050Settings: vda5050_checked,
}
FLEETS: Mapping[type[WireSettings], Callable[[Any], WireFleet]] = {
    MqttSettings: MqttFleet,
    RosSettings: RosFleet,
    Vda5050Settings: Vda5050Fleet,
}
STAND_INS: Mapping[type[WireSettings], Callable[[Any, Callable[[str], None]], Any]] = {
    MqttSettings: MqttStandIns,
    RosSettings: RosStandIns,
    Vda5050Settings: Vda5050StandIns,
}


@app.command()
def check(file: File, seconds: Seconds = 3.0) -> None:
    """Check which robots are there and what is wrong; moves nothing.

    The exit code is 4 if anything is wrong.
    """
    settings = described_as(WireSettings, file)
    told, fit = CHECKUPS[type(settings)](settings, seconds)
    say("\n".join(told))
    raise typer.Exit(0 if fit else 4)


@app.command()
def stop(file: File) -> None:
    """Hold all robots at once, whoever drives them. Ends with 4 unless all are seen to stand."""
    settings = to_be_stopped(file)
    told, stand = asyncio.run(stopped(FLEETS[type(settings)](settings)))
    say("\n".join(told))
    raise typer.Exit(0 if stand else 4)


@app.command()
def simulate(file: File) -> None:
    """Stand in for a fleet's robots, over its protocol, until Ctrl-C."""
    settings = described_as(WireSettings, file)
    robots = STAND_INS[type(settings)](settings, lambda text: say(f"formup: {text}"))
    say(f"formup: standing in for {len(settings.robots)} robots at {settings.where}.")
    try:
        robots.run()
    finally:
        robots.close()
