"""Models by name: who decides in a run."""

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
    """Look a model up.

    Args:
        name: one of `MODELS`, such as openai:gpt-5.
        base_url: of a server that speaks as the provider does; None for the provider's own.
        show: is given fragments of the model's text as they come, or None where a reply begins
            anew; it decides nothing.

    Raises:
        InputError: there is none of that name, no usable base URL, or no key for it.
    """
    provider, _, model = name.partition(":")
    if provider in PROVIDERS and model.strip():
        from .remote import remote_model  # not before: it loads the HTTP library

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
