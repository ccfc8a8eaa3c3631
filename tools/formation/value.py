"""The base of all values that are stored, hashed and compared."""

from pydantic import BaseModel, ConfigDict


class Value(BaseModel):
    """An immutable model that takes no fields it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid")
