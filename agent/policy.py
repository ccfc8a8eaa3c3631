"""Which tool calls may go ahead, which wait for a person, which are refused.

A policy can only be stricter than the tools are: questions always wait, and so do real robots,
since the tool that moves them demands an approved plan.
"""

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal

from ..tools.errors import InputError
from ..tools.tool import Tool

Decision = Literal["allow", "ask", "refuse"]
DECISIONS: tuple[Decision, ...] = ("allow", "ask", "refuse")
"""From the least strict to the strictest."""


@dataclass(frozen=True)
class Policy:
    """Rules of (glob, decision); the first whose glob fits a tool's name decides.

    Raises:
        InputError: an unknown decision.
    """

    rules: tuple[tuple[str, Decision], ...] = ()

    def __post_init__(self) -> None:
        for glob, decision in self.rules:
            if decision not in DECISIONS:
                raise InputError(
                    f"{glob}={decision} is no rule of a policy: say allow, ask or refuse."
                )

    def decide(self, tool: Tool) -> Decision:
        """Return what is to happen with a call of a tool."""
        rules = [decision for glob, decision in self.rules if fnmatchcase(tool.name, glob)]
        least = "ask" if tool.kind == "ask" else "allow"
        return DECISIONS[max(map(DECISIONS.index, (*rules[:1], least)))]
