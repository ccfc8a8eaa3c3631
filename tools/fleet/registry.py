"""Fleets by name: those of formup, and those of installed packages."""

from ..registry import Registry
from .protocol import FleetFactory

FLEETS = Registry[FleetFactory](
    "fleet",
    "formup.fleets",
    {
        "simulated": "formup.tools.fleet.simulated:open_fleet",
        "mqtt": "formup.tools.fleet.mqtt.fleet:open_fleet",
        "recorded": "formup.tools.fleet.recorded:open_fleet",
        "ros": "formup.tools.fleet.ros.fleet:open_fleet",
        "vda5050": "formup.tools.fleet.vda5050.fleet:open_fleet",
    },
)
