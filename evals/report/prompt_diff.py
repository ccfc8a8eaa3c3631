"""How the prompts of A and B differ, found by the hashes that the trials name."""

from ...prompts import Prompt, PromptError, PromptLibrary
from ...prompts.history import diff
from ..experiments.trials import Arm


def prompt_diff(a: Arm, b: Arm, library: PromptLibrary) -> list[str]:
    """The lines of a unified diff, or one that says whose text is gone; none for one text."""
    if a.prompt is None or b.prompt is None or (a.prompt, a.sha256) == (b.prompt, b.sha256):
        return []
    old, new = (_tried(arm, library) for arm in (a, b))
    if old is None or new is None:
        gone = " and ".join(str(arm.prompt) for arm, p in ((a, old), (b, new)) if p is None)
        return [f"The text of {gone} as it was tried is not among the prompts (see --prompts)."]
    return diff(old, new)


def _tried(arm: Arm, library: PromptLibrary) -> Prompt | None:
    """The prompt an arm was given; a draft may have become a version since."""
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
