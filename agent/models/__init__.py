"""Models by name: who decides in a run."""

from ...tools.errors import InputError
from ..model import Model
from .offline import OfflinePlanner

MODELS = ("offline",)


def model_named(name: str) -> Model:
    """Look a model up.

    Raises:
        InputError: there is none of that name; the text lists those there are.
    """
    if name != "offline":
        raise InputError(f"Unknown model {name!r}. There are: {', '.join(MODELS)}.")
    return OfflinePlanner()
