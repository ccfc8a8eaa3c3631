"""The texts sent to the model: versioned prompt files, named `id@vNNN` and identified by hash."""

from .library import PromptLibrary
from .prompt import Prompt, PromptError

__all__ = ["Prompt", "PromptError", "PromptLibrary", "load_prompt"]


def load_prompt(name: str) -> Prompt:
    """Read a prompt that ships with formup.

    Args:
        name: `id@vNNN`, such as former@v001, or an id alone for its current version.

    Raises:
        PromptError: there is no prompt of that name.
    """
    return PromptLibrary().load(name)
