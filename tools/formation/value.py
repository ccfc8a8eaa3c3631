"""Values that are stored and hashed: written alike by every version that knows them."""

from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, SerializerFunctionWrapHandler, model_serializer


class Value(BaseModel):
    """An immutable model that takes no fields it does not know.

    Attributes:
        later: names of fields that came later. They are written only where they differ from their
            defaults, so that digests and ids from before them hold.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    later: ClassVar[frozenset[str]] = frozenset()

    @model_serializer(mode="wrap")
    def _written(self, standard: SerializerFunctionWrapHandler) -> dict[str, Any]:
        silent = {
            name: field.get_default(call_default_factory=True)
            for name, field in type(self).model_fields.items()
            if name in self.later
        }
        return {k: v for k, v in standard(self).items() if k not in silent or v != silent[k]}
