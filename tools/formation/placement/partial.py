"""Finds the best plan if a contract cannot be met: with fewer robots, or a nearer clearance.

The result is certified by the same checker, and states what it falls short of.
"""

from collections.abc import Callable, Mapping
from typing import Any

from ...geometry.cages.budget import cut_short, search_budget
from ..contract import Contract, Group, with_defaults
from ..plan import Plan, Shortfall, make_plan
from ..site import CapacityError, PlacementError, Site
from .caging import CUT_SHORT, CageError, escape_proof
from .group_conflicts import CrowdedError

ROUNDS = 60
"""Most times that robots are taken out of a group."""
TENTH = 10
"""Clearances are tried in steps of a tenth of a pixel."""
LESS = tuple(k / 12 for k in range(1, 12))
"""Shares of robots to take out of two groups, tried until they no longer crowd each other."""
COARSE = 5
"""Steps of the search for the clearance of an escape-proof cage, each of which may take a second or
more."""
ROUND = frozenset({"around", "cage"})
OPEN = 1000.0
"""A greatest clearance of this or more, px, means that there is none."""


Attempt = Callable[[Contract], Plan]
Counts = tuple[int, int]


def best_partial(
    contract: Contract, site: Site, scene_version: str, refusal: PlacementError | None
) -> Plan | None:
    """Return a certified plan that falls as little short of a contract as is known, as partial.

    It places as many robots as fit or, if that gives no plan, all of them at the greatest clearance
    up to the stated one that can be held. A clearance that was left open is not changed.

    Args:
        contract: the contract as stated, in px.
        site: the outlines and the picture.
        scene_version: version of the scene.
        refusal: why not all robots can be placed; None if they can, but the plan is not certified.

    Returns:
        None if no certified plan was found, for example because a cage needs more robots.
    """
    if isinstance(refusal, CageError) and refusal.needed is not None:
        return None
    full = with_defaults(contract, site.outlines, site.room)

    def attempt(smaller: Contract) -> Plan:
        if cut_short() and any(map(escape_proof, smaller.groups)):
            raise PlacementError(CUT_SHORT.strip())
        return make_plan(smaller, site, scene_version)

    with search_budget():
        fewer = None if refusal is None else _with_fewer_robots(full, attempt)
        found = fewer or _at_smaller_clearance(contract, full, attempt, site)
        if found is None or found.partial is None or not cut_short():
            return found
        short = found.partial.model_copy(update={"sentence": found.partial.sentence + CUT_SHORT})
        return found.model_copy(update={"partial": short})


def _with_fewer_robots(full: Contract, attempt: Attempt) -> Plan | None:
    """Return a partial plan with as many robots as fit, reducing group after group, or None."""
    smaller, names = full, list(range(len(full.groups)))
    for _ in range(ROUNDS):
        try:
            plan = attempt(smaller)
        except CrowdedError as error:
            fewer = _parted(smaller, (error.first, error.second), attempt)
            alone = _without_group(smaller, error.second)
            if fewer is None or fewer.robots < alone.robots:
                names.pop(error.second)
                fewer = alone
        except (CapacityError, CageError) as error:
            fewer = _with_counts(smaller, {smaller.groups.index(error.group): error.fits})
        except PlacementError:  # cut short
            return None
        else:
            short = plan.verdict.certified and smaller != full
            partial = {"partial": _shortfall(full, smaller, names)}
            return plan.model_copy(update=partial) if short else None
        if fewer is None:
            return None
        smaller = fewer
    return None


def _with_counts(contract: Contract, robots: Mapping[int, int]) -> Contract | None:
    """Return the contract with other robot counts, by group index; None if one is too small."""
    if any(n < (3 if contract.groups[k].relation == "cage" else 1) for k, n in robots.items()):
        return None
    return _changed(contract, {index: {"robots": count} for index, count in robots.items()})


def _changed(contract: Contract, updates: Mapping[int, Mapping[str, Any]]) -> Contract:
    """Return the contract with some groups' fields updated, by group index."""
    groups = enumerate(contract.groups)
    changed = tuple(g.model_copy(update=updates.get(index, {})) for index, g in groups)
    return contract.model_copy(update={"groups": changed})


def _parted(contract: Contract, pair: tuple[int, int], attempt: Attempt) -> Contract | None:
    """Reduce two groups that crowd each other until they do not, keeping the most robots.

    Either the second group gives way, or the first, or both by the same share.
    """
    first, second = pair
    n, m = (contract.groups[index].robots for index in pair)
    before = contract.model_copy(update={"groups": contract.groups[: second + 1]})

    def works(counts: Counts) -> bool:
        smaller = _with_counts(before, dict(zip(pair, counts, strict=True)))
        return smaller is not None and _tried(attempt, smaller) is not None

    def share(k: int) -> Counts:
        return n - k, max(round(m * (1 - k / n)), 1)

    ways = (
        _fewest_less(lambda k: (n, m - k), m, works),
        _fewest_less(lambda k: (n - k, m), n, works),
        _fewest_less(share, n, works),
    )
    counts = max((c for c in ways if c is not None), key=sum, default=None)
    return counts and _with_counts(contract, {first: counts[0], second: counts[1]})


def _fewest_less(
    counts: Callable[[int], Counts], most: int, works: Callable[[Counts], bool]
) -> Counts | None:
    """Return the counts with the fewest robots taken out that work, as far as bisection finds them.

    `counts` maps the number taken out to the two groups' counts.
    """
    tried = sorted({k for share in LESS if 0 < (k := round(share * most)) < most})
    high = next((k for k in tried if works(counts(k))), None)
    if high is None:
        return None
    low = max((k for k in tried if k < high), default=0)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if works(counts(middle)) else (middle, high)
    return counts(high)


def _without_group(contract: Contract, index: int) -> Contract:
    groups = (*contract.groups[:index], *contract.groups[index + 1 :])
    return contract.model_copy(update={"groups": groups})


def _shortfall(full: Contract, smaller: Contract, names: list[int]) -> Shortfall:
    """Return the shortfall in robots; `names` are the original indices of the groups left."""
    asked, placed = full.robots, smaller.robots
    have = "has a place" if placed == 1 else "have places"
    left = dict(zip(names, smaller.groups, strict=True))
    counts = [(left[i].robots if i in left else 0, g.robots) for i, g in enumerate(full.groups)]
    each = [
        f"{few} of {all_} in group {i}" for i, (few, all_) in enumerate(counts, 1) if few < all_
    ]
    where = f": {', '.join(each)}" if len(counts) > 1 else ""
    sentence = f"{placed} of the {asked} robots {have}{where}."
    return Shortfall(asked=asked, placed=placed, sentence=sentence)


def _at_smaller_clearance(
    stated: Contract, full: Contract, attempt: Attempt, site: Site
) -> Plan | None:
    """Return a partial plan with the greatest clearance that can be held in some group, or None.

    The first group for which this succeeds is reduced. A ring all the way round is preferred to a
    wider one that the picture cuts.
    """
    for index, (said, group) in enumerate(zip(stated.groups, full.groups, strict=True)):
        if said.clearance is None or not group.keeps_clearance:
            continue
        whole = _greatest(full, index, attempt, _uncut)
        plan = whole or _greatest(full, index, attempt)
        if plan is None:
            continue
        held = plan.formation.contract.groups[index]
        sentence = (
            f"{_clearance_text(held, site)} is the greatest clearance found that can be held"
            f"{' all round' if whole and group.relation in ROUND else ''}, "
            f"not {_clearance_text(group, site)}."
        )
        short = Shortfall(
            asked=full.robots,
            placed=full.robots,
            clearance_asked=group.clearance,
            clearance=held.clearance,
            sentence=sentence,
        )
        return plan.model_copy(update={"partial": short})
    return None


def _greatest(
    full: Contract,
    index: int,
    attempt: Attempt,
    suits: Callable[[Plan], bool] = lambda plan: True,
) -> Plan | None:
    """Return the plan at a group's greatest clearance that is certified and suits, by bisection."""
    group = full.groups[index]
    least, greatest = group.offsets()
    aim = least or greatest
    works, fails, best = 0, int(aim * TENTH), None
    steps = COARSE if escape_proof(group) else fails.bit_length()
    for _ in range(steps):
        if fails - works < 2:
            break
        middle = (works + fails) // 2 if best or fails < 4 else max(fails // 2, 1)
        clearance = _at_share(group, middle / TENTH / aim)
        plan = _tried(attempt, _changed(full, {index: {"clearance": clearance}}))
        if plan is None or not suits(plan):
            fails = middle
        else:
            works, best = middle, plan
    return best


def _uncut(plan: Plan) -> bool:
    return "ring_in_picture" not in plan.verdict.measures


def _at_share(group: Group, share: float) -> tuple[float, float]:
    """Scale the group's clearance by a share; for inside only the least, which is what hinders."""
    least, greatest = group.offsets()
    deep = greatest >= OPEN or group.relation == "inside"
    return round(least * share, 3), greatest if deep else max(round(greatest * share, 3), 0.1)


def _tried(attempt: Attempt, contract: Contract) -> Plan | None:
    try:
        plan = attempt(contract)
    except PlacementError:
        return None
    return plan if plan.verdict.certified else None


def _clearance_text(group: Group, site: Site) -> str:
    least, greatest = group.offsets()
    if greatest >= OPEN or group.relation == "inside":
        return f"{site.length(least)} or more"
    return site.length((least, greatest))
