"""formup: say where a team of robots should stand, get it certified, watch them arrive."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .agent.agent import Agent
    from .agent.limits import Limits
    from .agent.messages import Call, Reply, Result, User
    from .agent.outcomes import Answered, Cancelled, Paused, Stopped
    from .agent.policy import Policy
    from .agent.report import Report
    from .agent.service import Service
    from .agent.session import Run, load_run
    from .agent.stopping import is_stop
    from .agent.store.places import store_at
    from .agent.wrappers.doubles import FunctionModel, ScriptedModel
    from .tools.builtin import TOOLS
    from .tools.context import Context, Settings
    from .tools.errors import (
        FleetError,
        FormupError,
        ImageError,
        InputError,
        ModelError,
        ToolError,
    )
    from .tools.fleet.arrival import Arrival
    from .tools.formation.checking.check import certify
    from .tools.formation.checking.verdict import Finding, Verdict
    from .tools.formation.contract import Contract, Group
    from .tools.formation.plan import Formation, Plan, make_plan
    from .tools.geometry.outline import Outline, make_outline
    from .tools.perception.image import Picture, load_picture, picture_from_bytes
    from .tools.perception.target_prompt import TargetPrompt
    from .tools.tool import Tool, ToolResult, tool
    from .tools.world import Target, World

_HOMES = {
    "agent.agent": ("Agent",),
    "agent.stopping": ("is_stop",),
    "agent.limits": ("Limits",),
    "agent.messages": ("Call", "Reply", "Result", "User"),
    "agent.wrappers.doubles": ("FunctionModel", "ScriptedModel"),
    "agent.outcomes": ("Answered", "Cancelled", "Paused", "Stopped"),
    "agent.policy": ("Policy",),
    "agent.report": ("Report",),
    "agent.service": ("Service",),
    "agent.session": ("Run", "load_run"),
    "agent.store.places": ("store_at",),
    "tools.builtin": ("TOOLS",),
    "tools.context": ("Context", "Settings"),
    "tools.errors": (
        "FleetError",
        "FormupError",
        "ImageError",
        "InputError",
        "ModelError",
        "ToolError",
    ),
    "tools.fleet.deploy": ("Arrival",),
    "tools.formation.checking.check": ("certify",),
    "tools.formation.contract": ("Contract", "Group"),
    "tools.formation.plan": ("Formation", "Plan", "make_plan"),
    "tools.formation.checking.verdict": ("Finding", "Verdict"),
    "tools.geometry.outline": ("Outline", "make_outline"),
    "tools.perception.image": ("Picture", "load_picture", "picture_from_bytes"),
    "tools.perception.target_prompt": ("TargetPrompt",),
    "tools.tool": ("Tool", "ToolResult", "tool"),
    "tools.world": ("Target", "World"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Agent",
    "Answered",
    "Arrival",
    "Call",
    "Cancelled",
    "Context",
    "Contract",
    "Finding",
    "FleetError",
    "Formation",
    "FormupError",
    "FunctionModel",
    "Group",
    "ImageError",
    "InputError",
    "Limits",
    "ModelError",
    "Outline",
    "Paused",
    "Picture",
    "Plan",
    "Policy",
    "Reply",
    "Report",
    "Result",
    "Run",
    "ScriptedModel",
    "Service",
    "Settings",
    "Stopped",
    "TOOLS",
    "Target",
    "TargetPrompt",
    "Tool",
    "ToolError",
    "ToolResult",
    "User",
    "Verdict",
    "World",
    "certify",
    "is_stop",
    "load_picture",
    "load_run",
    "make_outline",
    "make_plan",
    "picture_from_bytes",
    "store_at",
    "tool",
]


def __getattr__(name: str) -> object:
    """Import a public name when it is first used, so that `import formup` stays light."""
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME_OF[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
