"""The JSON that robots on MQTT say and are told."""

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..wire.poses import PoseMessage

MOST_BYTES = 4_096


class GoalMessage(BaseModel):
    """Where a robot is to go, straight.

    Attributes:
        drive: names the drive it belongs to; after a hold, goals of the same drive are not obeyed.
        seq: a number that rises within a drive; what comes later with a lower one is not obeyed.
        x, y: in the robots' frame.
        heading: which way it is to look there, radians about the x axis towards the y axis; left
            out, any way.
    """

    model_config = ConfigDict(strict=True, allow_inf_nan=False)
    drive: str = Field(max_length=100)
    seq: int
    x: float
    y: float
    heading: float | None = None


def pose_message(payload: bytes) -> PoseMessage | None:
    """What a robot says of itself; None where that cannot be read."""
    if len(payload) > MOST_BYTES:
        return None
    try:
        return PoseMessage.model_validate_json(payload)
    except ValidationError:
        return None
