"""What a file says of robots on MQTT beside what it says of all that are elsewhere: the broker and
the topics."""

from typing import Annotated, Self
from urllib.parse import urlsplit

from pydantic import Field, StringConstraints, field_validator, model_validator

from ...formation.value import Value
from ..wire.settings import WireSettings

PORTS = {"mqtt": 1883, "mqtts": 8883}
Topic = Annotated[str, StringConstraints(pattern=r"^[^+#\x00-\x1f]{1,200}$")]


class Topics(Value):
    """Where messages go.

    Attributes:
        pose: where robots are, one level of it `{robot}`.
        goal: where they are to go, likewise.
        hold: tells all robots to hold.
    """

    pose: Topic = "formup/{robot}/pose"
    goal: Topic = "formup/{robot}/goal"
    hold: Topic = "formup/hold"

    @model_validator(mode="after")
    def _told_apart(self) -> Self:
        for topic in (self.pose, self.goal):
            if topic.split("/").count("{robot}") != 1 or topic.count("{") != 1:
                raise ValueError(f"one level of {topic!r} has to be {{robot}}, and only one")
        if "{" in self.hold or len({self.pose, self.goal, self.hold}) < 3:
            raise ValueError("pose, goal and hold are three topics, of which hold has no {robot}")
        return self


class BrokerSettings(WireSettings):
    """Robots that are reached through an MQTT broker.

    Attributes:
        broker: mqtt://HOST:PORT, or mqtts:// for TLS. Who logs in is said by the environment.
    """

    broker: Annotated[str, Field(max_length=300)]

    @field_validator("broker")
    @classmethod
    def _is_address(cls, broker: str) -> str:
        parts = urlsplit(broker)
        if "@" in parts.netloc:
            raise ValueError(
                "leave out who logs in: a file is read by many; set FORMUP_MQTT_USERNAME and "
                "FORMUP_MQTT_PASSWORD"
            )
        if parts.scheme not in PORTS or not parts.hostname or parts.path.strip("/"):
            raise ValueError(f"give mqtt://HOST:PORT, or mqtts:// for TLS, got {broker!r}")
        if parts.port == 0:  # looking at it raises where it is no number
            raise ValueError("a port is 1 to 65535, got 0")
        return broker

    @property
    def address(self) -> tuple[str, int, bool]:
        """Host and port of the broker, and whether TLS is spoken."""
        parts = urlsplit(self.broker)
        return parts.hostname or "", parts.port or PORTS[parts.scheme], parts.scheme == "mqtts"

    @property
    def where(self) -> str:
        """The broker in words."""
        host, port, _ = self.address
        return f"the broker {host}:{port}"


class MqttSettings(BrokerSettings):
    """Robots that speak plain JSON over MQTT.

    Attributes:
        topics: where their messages go.
    """

    topics: Topics = Topics()

    def robot_of(self, topic: str, pattern: str) -> str | None:
        """The robot whose topic of a pattern this is; None where it is of another pattern."""
        before, after = pattern.split("{robot}")
        robot = topic.removeprefix(before).removesuffix(after)
        return robot if "/" not in robot and topic == before + robot + after else None
