"""The tools a prompt was released for, whose descriptions may have changed since."""

import hashlib
import json

from ...prompts import Prompt, PromptLibrary
from ...prompts.lint import Finding
from ...prompts.lock import read_lock
from ...tools.builtin import TOOLS
from ...tools.tool import Tool


def tool_hashes(prompt: Prompt, tools: tuple[Tool, ...] = TOOLS) -> dict[str, str]:
    """Return hashes of the descriptions and schemas of the tools offered with a prompt, by name."""
    offered = [t for t in tools if not prompt.tools or t.name in prompt.tools]
    return {tool.name: _hash(tool) for tool in offered}


def retooled(
    library: PromptLibrary, prompt: Prompt, tools: tuple[Tool, ...] = TOOLS
) -> list[Finding]:
    """Return findings on tools that have changed since a prompt was released, or do not exist."""
    unknown = sorted(set(prompt.tools) - {t.name for t in tools})
    found = [
        Finding(prompt.name, "tools", "warning", f"It names {name}, which is no tool of formup.")
        for name in unknown
    ]
    locked = read_lock(library.home(prompt.id)).get(prompt.name)
    now = tool_hashes(prompt, tools)
    then = now if locked is None else locked.tools
    changed = sorted(name for name in then if then[name] != now.get(name, then[name]))
    if changed:
        text = f"Released for {', '.join(changed)} as they were then; compare it again."
        found.append(Finding(prompt.name, "tools", "warning", text))
    return found


def _hash(tool: Tool) -> str:
    facts = json.dumps([tool.description, tool.schema], sort_keys=True)
    return hashlib.sha256(facts.encode()).hexdigest()[:12]
