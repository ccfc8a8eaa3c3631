"""Looks up models, which decide in a run, by name."""

from pathlib import Path

from ...tools.errors import InputError
from ..model import Model, ShowText
from ..offline.planner import OfflinePlanner

PROVIDERS = ("openai", "openai-responses", "anthropic", "gemini", "ollama")
MODELS = ("offline", *(f"{provider}:NAME" for provider in PROVIDERS), "replay:FILE")


def model_named(
    name: str,
    base_url: str | None = None,
    show: ShowText | None = None,
) -> Model:
    """Return the model of a name.

    Args:
        name: one of `MODELS`, such as openai:gpt-5.
        base_url: of a server that speaks the provider's API; None for the provider's own.
        show: called with fragments of the model's text as they arrive, or None where a reply
            starts over; for display only.

    Raises:
        InputError: there is no model of that name, no usable base URL, or no key for it.
    """
    provider, _, model = name.partition(":")
    if provider in PROVIDERS and model.strip():
        from .remote import remote_model  # imported late: it loads the HTTP library

        return remote_model(provider, model.strip(), base_url, show=show)
    if name != "offline" and not (provider == "replay" and model):
        raise InputError(f"Unknown model {name!r}. There are: {', '.join(MODELS)}.")
    if base_url is not None:
        asks = "A replay asks" if model else "The offline rules ask"
        raise InputError(f"{asks} no server; a base URL goes with openai:NAME.")
    if model:
        from ..wrappers.replay import ReplayModel

        return ReplayModel(Path(model))
    return OfflinePlanner()
