"""A model whose turn begins with something that the person has to be told."""

from typing import Any

from ..messages import Reply
from ..model import Model, Request
from ..offline.besides import saying


class Telling:
    """A model that says something before its own words."""

    def __init__(self, model: Model, told: str) -> None:
        self.name, self._model, self._told = model.name, model, told

    def __getattr__(self, name: str) -> Any:
        """Return what else the model has, such as whether it sees."""
        return getattr(self._model, name)

    async def reply(self, request: Request) -> Reply:
        """Return the model's reply; one that ends or asks says first what has to be told."""
        return saying(self._told, await self._model.reply(request))
