"""Differences between the prompts of A and B, found by the hashes that the trials name."""

from ...prompts import Prompt, PromptError, PromptLibrary
from ...prompts.history import diff
from ..experiments.trials import Arm


def prompt_diff(a: Arm, b: Arm, library: PromptLibrary) -> list[str]:
    """Return the lines of a unified diff, or one that names the prompts whose text is gone.

    There are none if the two share a text, or one has no prompt.
    """
    if a.prompt is None or b.prompt is None or (a.prompt, a.sha256) == (b.prompt, b.sha256):
        return []
    old, new = (_tried(arm, library) for arm in (a, b))
    if old is None or new is None:
        gone = " and ".join(str(arm.prompt) for arm, p in ((a, old), (b, new)) if p is None)
        return [f"The text of {gone} as it was tried is not among the prompts (see --prompts)."]
    return diff(old, new)


def _tried(arm: Arm, library: PromptLibrary) -> Prompt | None:
    """Return the prompt an arm was given, if its text is still there.

    A draft may have become a version since.
    """
    id = str(arm.prompt).partition("@")[0]
    named = [name for name in library.names() if name.partition("@")[0] == id]
    for name in sorted(named, key=lambda name: name != arm.prompt):
        try:
            prompt = library.load(name)
        except PromptError:
            continue
        if prompt.sha256 == arm.sha256:
            return prompt
    return None
