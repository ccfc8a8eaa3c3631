"""Edits of an existing formation, as a conversation asks for them: "a bit further out".

An edit is a pure function from a plan to the next one with a new contract, certified like every
plan. Robots keep their identities: each goes to the image of its own place; if the places
themselves are new, the least sum of squared distances decides who takes which.
"""

from collections.abc import Callable, Collection, Sequence
from itertools import count

from ...errors import ToolError
from ...geometry.cages.budget import search_budget
from ..checking.verdict import Verdict
from ..contract import Contract
from ..placement.place import Site
from ..plan import Plan, make_plan
from ..value import Value
from .draft import Draft, draft_of
from .edit_kinds import Count, Edit, Spacing
from .edit_rules import RULES
from .off_things import off_things
from .ring_rules import RING_RULES
from .staying import displaced_robots, with_held, with_held_at_points, with_rings_turned_back
from .team_rules import TEAM_RULES


class Edited(Value):
    """The plan after edits, certified or with findings.

    Attributes:
        plan: the new plan.
        parent: id of the plan that was edited.
        robots: for each of the new plan's `points`, the id of the robot that goes there; None for
            an added robot.
    """

    plan: Plan
    parent: str
    robots: tuple[str | None, ...]


def edited(
    plan: Plan,
    edits: Sequence[Edit],
    site: Site,
    version: Callable[[Contract], str],
    stay: Collection[int] = (),
) -> Edited:
    """Apply edits one after another and return the new plan, certified or not.

    Args:
        plan: the plan to edit.
        edits: the edits, in order.
        site: with the outlines of all that the plan or an edit names, and as `others` what else is
            in the picture; of these, objects that the new contract names are ignored.
        version: returns the version of the part of the scene that a contract depends on.
        stay: numbers of robots that do not move; "robot k" is the one whose id is k, or the k-th
            in a fleet whose ids are not numbers.

    Raises:
        ToolError: an edit makes no sense for this plan; the text says why.
    """
    with search_budget():
        start = draft_of(plan, site)
        draft = with_rings_turned_back(_apply_edits(with_held(start, stay), edits), start)
        if displaced_robots(draft, start):
            draft = _apply_edits(with_held_at_points(start, stay), edits)
        if astray := displaced_robots(draft, start):
            names = " and ".join(map(str, astray))
            raise ToolError(f"Robot {names} cannot stay where it is and take part in that.")
        contract = draft.agreed()
        after = make_plan(contract, site, version(contract), draft.points)
        after = off_things(after, draft, plan.formation.points, {edit.kind for edit in edits})
    after = after.model_copy(update={"verdict": _with_robot_numbers(after.verdict, draft)})
    names = plan.formation.robot_of_place
    robots = tuple(None if i < 0 else names[i] for i in map(int, draft.was))
    return Edited(plan=after, parent=plan.id, robots=robots)


def _apply_edits(draft: Draft, edits: Sequence[Edit]) -> Draft:
    for edit in _merge_spacing_into_count(edits):
        if edit.kind in TEAM_RULES:
            draft = TEAM_RULES[edit.kind](draft, edit)
            continue
        rule = RULES.get(edit.kind) or RING_RULES[edit.kind]
        draft = draft.with_each(draft.chosen(edit), lambda part: rule(part, edit))  # noqa: B023
    return draft


def _merge_spacing_into_count(edits: Sequence[Edit]) -> Sequence[Edit]:
    """Merge a spacing into a count of as many robots as fit, as their least distance."""
    fit = next((e for e in edits if isinstance(e, Count) and e.robots == "fit"), None)
    apart = next((e for e in edits if isinstance(e, Spacing) and e.px is not None), None)
    if fit is None or apart is None:
        return edits
    both = fit.model_copy(update={"px": apart.px, "group": fit.group or apart.group})
    return [both if edit is fit else edit for edit in edits if edit is not apart]


def _with_robot_numbers(verdict: Verdict, draft: Draft) -> Verdict:
    """Return the verdict with robots numbered as the person numbers them, and the draft's notes."""
    used = set(draft.numbers)
    free = (n for n in count(1) if n not in used)
    names = [next(free) if i < 0 else draft.number(i) for i in draft.was.tolist()]
    findings = tuple(
        f.model_copy(
            update={
                "robot": None if f.robot is None else names[f.robot - 1],
                "others": tuple(names[k - 1] for k in f.others),
            }
        )
        for f in verdict.findings
    )
    notes = tuple(dict.fromkeys((*verdict.notes, *draft.notes)))
    return verdict.model_copy(update={"findings": findings, "notes": notes})
