"""A world as plain data for a web page to draw: outlines, areas, robots and their verdicts.

Frame: image pixels, x right, y down. Outlines are simplified to what a screen can show.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from ..fleet.protocol import Pose
from ..formation.checking.allowed import allowed_area
from ..formation.checking.verdict import parts_of
from ..formation.contract import OUTSIDE
from ..formation.editing.draft import numbers_of
from ..formation.plan import Plan
from ..formation.units import length_text
from ..geometry.outline import Outline, distances
from ..perception.referring.attributes import Candidate
from ..world import PlanNode, World
from .marks import rings

DETAIL = 0.5
"""Greatest deviation of a line on the page from the true one, px."""
MOST_PLANS = 40
"""The most plans that are listed, the newest ones."""
TELLING = ("min_clearance_px", "min_spacing_px", "widest_opening_px", "worst_gap_px")
"""Measures that a page lists for a plan."""
Rings = list[list[list[float]]]


def scene_data(world: World, plan_id: str | None = None) -> dict[str, Any]:
    """Return everything that a page draws of a world.

    Args:
        plan_id: the plan to show; by default the current one, else the one proposed last.
    """
    name = plan_id or world.current or next(reversed(world.plans), None)
    node = world.plans.get(name or "")
    met = {} if node is None else world.met(node.plan.id)
    hard = [(k.id, k.reason, k.outline) for k in world.keep_out if k.hard]
    reasons = {k.id: k.reason for k in world.keep_out} | {t.id: t.label for t in world.targets}
    return {
        "picture": world.picture.model_dump(),
        "metres_per_pixel": world.metres_per_pixel,
        "targets": [
            thing_data(t.id, t.label, t.outline) | {"confidence": t.confidence, "note": t.note}
            for t in world.with_doubted().targets
        ],
        "keep_out": [thing_data(*thing) for thing in hard],
        "met": [thing_data(name, reasons[name], outline) for name, outline in met.items()],
        "robots": [pose_data(pose) for pose in world.robots],
        "current": world.current,
        "plan": None if node is None else _plan_data(world, node),
        "plans": [_thumbnail_data(world, n) for n in list(world.plans.values())[-MOST_PLANS:]],
    }


def thing_data(name: str, label: str, outline: Outline) -> dict[str, Any]:
    """Return an outline with its id and label."""
    return {"id": name, "label": label, "rings": ring_data(outline.polygon)}


def candidate_data(candidates: Iterable[Candidate]) -> list[dict[str, Any]]:
    """Return candidates found in the picture, with how likely each is to be an object."""
    return [
        thing_data(c.id, c.label, c.outline) | {"salience": round(c.salience, 3)}
        for c in candidates
    ]


def pose_data(pose: Pose) -> dict[str, Any]:
    """Return a robot's pose, px, and its heading, radians clockwise from the x axis, or None."""
    return {"id": pose.id, "x": round(pose.x, 2), "y": round(pose.y, 2), "heading": pose.heading}


def ring_data(area: BaseGeometry) -> Rings:
    """Return an area's closed boundary lines, simplified and rounded to hundredths of a pixel."""
    return [line.round(2).tolist() for line in rings(area.simplify(DETAIL)) if len(line)]


def robot_data(plan: Plan, before: Plan | None = None) -> list[dict[str, Any]]:
    """Return each robot's place in a plan, its heading, and whether a finding concerns it.

    Args:
        plan: the plan.
        before: the plan it was made from; a robot that moved has its place there as `from`.
    """
    formation = plan.formation
    wrong = {str(f.robot) for f in plan.verdict.findings if f.robot is not None}
    wrong |= {str(k) for f in plan.verdict.findings for k in f.others}
    old = _places_of_robots(before) if before else dict[str, tuple[float, float]]()
    rows: list[dict[str, Any]] = []
    groups = [k for k, group in enumerate(formation.contract.groups) for _ in range(group.robots)]
    headings, numbers = formation.place_headings, {i: n for n, i in numbers_of(plan).items()}
    for i, name in enumerate(formation.robot_of_place):
        x, y = formation.points[i].tolist()
        row = {"id": name, "x": x, "y": y, "group": groups[i] + 1, "wrong": name in wrong}
        row["number"] = numbers[i]
        row["heading"] = headings[i] if i < len(headings) else None
        if name in old and math.dist(old[name], (x, y)) > DETAIL:
            row["from"] = old[name]
        rows.append(row)
    return rows


def verdict_data(plan: Plan) -> dict[str, Any]:
    """Return whether a plan is certified, and its certificate's statements as sentences."""
    verdict = plan.verdict
    return {
        "certified": verdict.certified,
        "partial": None if plan.partial is None else plan.partial.sentence,
        "findings": [finding.sentence for finding in verdict.findings],
        "notes": list(verdict.notes),
    }


def _places_of_robots(plan: Plan) -> Mapping[str, tuple[float, float]]:
    formation = plan.formation
    return {
        name: (float(x), float(y))
        for name, (x, y) in zip(formation.robot_of_place, formation.points, strict=True)
    }


def _thumbnail_data(world: World, node: PlanNode) -> dict[str, Any]:
    """Return what a thumbnail shows of a plan."""
    plan = node.plan
    return {
        "id": plan.id,
        "parent": node.parent,
        "words": node.words,
        "certified": plan.verdict.certified,
        "void": world.is_void(plan),
        "points": plan.formation.points.round(1).tolist(),
    }


def _plan_data(world: World, node: PlanNode) -> dict[str, Any]:
    plan, scale = node.plan, world.metres_per_pixel
    before = world.plans.get(node.parent or "")
    data: dict[str, Any] = {"id": plan.id, "parent": node.parent, "words": node.words}
    data |= {"void": world.is_void(plan), "radius": plan.formation.contract.robot_radius}
    data |= verdict_data(plan) | {"robots": robot_data(plan, before and before.plan)}
    if data["void"]:
        return data | {"areas": [], "groups": [], "measures": [], "worst": None}
    contract, site = plan.formation.contract, world.site(plan.formation.contract)
    parts = parts_of(contract, plan.formation.points, site)
    picture = shapely.box(-0.5, -0.5, site.width - 0.5, site.height - 0.5)
    areas = [area.intersection(picture) for p in parts if (area := allowed_area(p)) is not None]
    arrival = world.arrivals.get(plan.id)
    return data | {
        "areas": [ring_data(area) for area in areas],
        "groups": _groups(plan, world),
        "measures": [
            f"{name.removesuffix('_px').replace('_', ' ')} {length_text(float(value), scale)}"
            for name, value in plan.verdict.measures.items()
            if name in TELLING and isinstance(value, int | float)
        ],
        "worst": _nearest_robot_data(plan, world),
        "motion": node.motion and node.motion.model_dump(mode="json"),
        "arrival": arrival and arrival.model_dump(mode="json"),
    }


def _clearances_of_robots(plan: Plan, world: World) -> dict[str, float]:
    """Return the clearance, px by robot id, of robots that stand outside a target.

    It is measured from the robot's edge to the target's filled outline.
    """
    contract, formation = plan.formation.contract, plan.formation
    names, off, first = formation.robot_of_place, dict[str, float](), 0
    for group in contract.groups:
        members = slice(first, first + group.robots)
        first += group.robots
        if group.relation in OUTSIDE:
            solid = world.outline(group.targets[0]).filled
            apart = distances(solid, formation.points[members]) - contract.robot_radius
            off |= dict(zip(names[members], apart.tolist(), strict=True))
    return off


def _groups(plan: Plan, world: World) -> list[dict[str, Any]]:
    """Return the contract's groups, with the least clearance, px, of those outside a target."""
    off, first, rows = _clearances_of_robots(plan, world), 0, list[dict[str, Any]]()
    for group in plan.formation.contract.groups:
        names = plan.formation.robot_of_place[first : first + group.robots]
        first += group.robots
        row = group.model_dump(mode="json", exclude_none=True)
        if group.relation in OUTSIDE:
            row["nearest_px"] = round(min(off[name] for name in names), 1)
        rows.append(row)
    return rows


def _nearest_robot_data(plan: Plan, world: World) -> dict[str, Any] | None:
    """Return the robot nearest to the target it stands around, and its edge's distance as text.

    None if no robot stands outside a target.
    """
    off = _clearances_of_robots(plan, world)
    if not off:
        return None
    robot = min(off, key=lambda name: off[name])
    return {"robot": robot, "text": length_text(off[robot], world.metres_per_pixel)}
