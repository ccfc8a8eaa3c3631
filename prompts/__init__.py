"""What the model is told: versioned prompt files, found by `id@vNNN` and known by their hash."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import yaml

_ROOT = Path(__file__).parent


class PromptError(ValueError):
    """There is no such prompt; the text lists those there are."""


@dataclass(frozen=True)
class Prompt:
    """One version of a prompt; `sha256` is of its text.

    Attributes:
        tools: names of the tools a model is offered with it; none stands for all.
    """

    id: str
    version: int
    summary: str
    text: str
    tools: tuple[str, ...] = ()

    @property
    def sha256(self) -> str:
        """Hash of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def name(self) -> str:
        """`id@vNNN`."""
        return f"{self.id}@v{self.version:03d}"


def list_prompts() -> list[str]:
    """Names of all prompts, sorted."""
    files = _ROOT.glob("*/v[0-9][0-9][0-9].prompt.md")
    return sorted(f"{f.parent.name}@{f.name[:4]}" for f in files)


def load_prompt(name: str) -> Prompt:
    """Read a prompt.

    Args:
        name: `id@vNNN`, such as former@v001.

    Raises:
        PromptError: there is none of that name.
    """
    if name not in list_prompts():
        raise PromptError(f"Unknown prompt {name!r}. There are: {', '.join(list_prompts())}.")
    folder, _, version = name.partition("@")
    content = (_ROOT / folder / f"{version}.prompt.md").read_text(encoding="utf-8")
    _, front, body = content.split("---\n", 2)
    facts = yaml.safe_load(front)
    tools = tuple(facts.get("tools", ()))
    return Prompt(facts["id"], facts["version"], facts["summary"], body.strip() + "\n", tools)
