"""The tools without one part of what they do, to see what it is worth; only for evaluation.

Their names and schemas stay the same. A plan that is not certified reaches no fleet: the planned
positions are taken for observed ones, and nothing moves.
"""

from dataclasses import replace
from inspect import isawaitable
from typing import Any, Literal

from ...tools.builtin import TOOLS
from ...tools.builtin.committing import deploy, propose_formation
from ...tools.builtin.editing import edit_formation
from ...tools.context import Context
from ...tools.errors import ToolError
from ...tools.fleet.arrival import Arrival
from ...tools.tool import Tool, ToolFunction, ToolResult

Part = Literal["certificate", "doubts", "look"]
"""The certificate of a formation, the doubts about a contract, or the look at an outline before
robots move."""


def tools_without(part: Part | None) -> tuple[Tool, ...]:
    """Return all tools, with the part left out of those that have it."""
    changed: dict[Part | None, dict[str, ToolFunction]] = {
        "certificate": {
            propose_formation.name: _propose_uncertified,
            deploy.name: _deploy_or_assume,
        },
        "doubts": {propose_formation.name: _propose_undoubted},
        "look": {t.name: _without_look(t) for t in (propose_formation, edit_formation)},
    }
    functions = changed.get(part, {})
    return tuple(replace(t, function=functions.get(t.name, t.function)) for t in TOOLS)


async def _call_tool(tool: Tool, context: Context, given: dict[str, Any]) -> ToolResult:
    """Call one of formup's own tools and return its result."""
    made = tool.function(context, **given)
    made = await made if isawaitable(made) else made
    assert isinstance(made, ToolResult)
    return made


async def _propose_uncertified(context: Context, **given: Any) -> ToolResult:
    """Propose a formation; the model is told that it is certified, whatever was found."""
    made = await _call_tool(propose_formation, context, given)
    if made.data["certified"]:
        return made
    data = {k: v for k, v in made.data.items() if k not in ("partial", "next")}
    message = None if context.settings.may_deploy else given["tell"]
    return replace(made, data=data | {"certified": True, "findings": []}, message=message)


async def _deploy_or_assume(context: Context, **given: Any) -> ToolResult:
    """Deploy a plan that is certified; else take its planned positions for observed ones."""
    node = context.world.plans.get(given["plan_id"] or context.proposed or "")
    if node is None or node.plan.verdict.certified or not context.settings.may_deploy:
        return await _call_tool(deploy, context, given)
    places, robots = node.plan.formation.positions, node.plan.formation.robots
    arrival = Arrival(
        arrived=True,
        ended="arrived",
        robots=robots,
        certified=False,
        observed=places,
        residual_px=(0.0,) * len(places),
        tolerance_px=0.0,
        corrections=0,
    )
    data = {"plan_id": node.plan.id, "arrived": True, "corrections": 0, "tolerance_px": 0.0}
    data |= {"worst_residual_px": 0.0, "worst_robot": next(iter(robots), "1")}
    world = context.world.with_arrival(node.plan.id, arrival)
    return ToolResult(data, world=world, message=given["tell"])


async def _propose_undoubted(context: Context, **given: Any) -> ToolResult:
    """Propose a formation, with its contract taken for what the words say."""
    try:
        return await _call_tool(propose_formation, context, given)
    except ToolError as error:
        if error.kind != "doubt":
            raise
        known = replace(context, doubted=context.doubted.union(error.facts["doubts"]))
    meant = given["contract"].model_copy(update={"reading": "not asked for"})
    return await _call_tool(propose_formation, known, given | {"contract": meant})


def _without_look(tool: Tool) -> ToolFunction:
    """Return a tool whose first certified plan is carried out, whatever its outlines look like."""

    async def function(context: Context, **given: Any) -> ToolResult:
        made = await _call_tool(tool, context, given)
        if made.world is None or "look_first" not in made.data:
            return made
        node = made.world.latest.model_copy(update={"unseen": ()})
        world = made.world.with_plan(node)
        if context.settings.may_deploy:
            tell = given["tell"] or "They stand there."
            called = {"plan_id": node.plan.id, "tell": tell, "follow": None}
            return await _call_tool(deploy, context.at(world), called)
        data = {k: v for k, v in made.data.items() if k != "look_first"}
        return ToolResult(data, world=world, message=given["tell"])

    return function
