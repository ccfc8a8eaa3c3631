"""What a file says of vehicles that speak VDA 5050 beside what it says of all behind a broker."""

import re
from typing import Annotated, Any, Self

from pydantic import ConfigDict, Field, StringConstraints, model_validator

from ...formation.value import Value
from ..mqtt.settings import BrokerSettings
from ..physics import RobotId
from .spec import DIALECTS, Dialect, Version

Level = Annotated[str, StringConstraints(pattern=r"^[^/+#$\x00-\x1f]{1,64}$")]
SERIAL = r"^[A-Za-z0-9_.:-]{1,64}$"


class Nameplate(Value):
    """How a robot is called by its maker.

    Attributes:
        serial: its serial number.
        manufacturer: as in topics; left out, that of the others.
    """

    serial: Annotated[RobotId, StringConstraints(pattern=SERIAL)]
    manufacturer: Level | None = None


def _without_watchdog(schema: dict[str, Any]) -> None:
    schema["properties"].pop("watchdog", None)


class Vda5050Settings(BrokerSettings):
    """Vehicles that speak VDA 5050.

    Attributes:
        version: of VDA 5050.
        interface: the first level of all topics.
        manufacturer: of the vehicles.
        map: the id of the map in which they say where they are.
        vehicles: by their ids, robots whose ids are not their serial numbers, or of other makers.
    """

    model_config = ConfigDict(json_schema_extra=_without_watchdog)
    version: Version
    interface: Level
    manufacturer: Level
    map: Annotated[str, StringConstraints(min_length=1, max_length=200)]
    vehicles: dict[RobotId, Nameplate] = Field(default={})

    @model_validator(mode="after")
    def _nameable(self) -> Self:
        if "watchdog" in self.model_fields_set:
            raise ValueError("leave out watchdog: vehicles of VDA 5050 have none")
        if unknown := sorted(set(self.vehicles) - set(self.robots)):
            raise ValueError(f"vehicles names robot {', '.join(unknown)}, which there is not")
        for robot in self.robots:
            if not re.match(SERIAL, self.named(robot)[1]):
                raise ValueError(
                    f"robot {robot!r} is no serial number, which has letters, digits and _.:- "
                    "alone; name one under vehicles"
                )
        if len({self.named(robot) for robot in self.robots}) < len(self.robots):
            raise ValueError("two robots have one manufacturer and serial number")
        return self

    @property
    def dialect(self) -> Dialect:
        """What is particular to the version."""
        return DIALECTS[self.version]

    def named(self, robot: str) -> tuple[str, str]:
        """Manufacturer and serial number of a robot."""
        vehicle = self.vehicles.get(robot)
        if vehicle is None:
            return self.manufacturer, robot
        return vehicle.manufacturer or self.manufacturer, vehicle.serial

    def topic(self, robot: str, kind: str) -> str:
        """A topic of a robot; + stands for all robots, of this file or not."""
        named = "+/+" if robot == "+" else "/".join(self.named(robot))
        return f"{self.interface}/{self.dialect.level}/{named}/{kind}"

    @property
    def alone(self) -> str:
        """What robots do that hear nothing more."""
        return "vehicles drive on to the last node released to them, at most 0.5 s away, and stand"
