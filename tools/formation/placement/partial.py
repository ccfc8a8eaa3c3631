"""The best that can be done where a contract cannot be met: fewer robots, or a nearer clearance.

Whatever comes of it is certified by the same checker, and says of itself what it falls short of.
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
"""Times that robots are taken out of one group or another."""
TENTH = 10
"""Clearances are tried in steps of a tenth of a pixel."""
LESS = tuple(k / 12 for k in range(1, 12))
"""Shares of two groups' robots taken out in search of places where they are not in each other's
way."""
COARSE = 5
"""Halvings of a clearance for an escape-proof cage, each of which may take a second or more."""
ROUND = frozenset({"around", "cage"})
OPEN = 1000.0
"""A greatest clearance from here on, px, only says that there is none."""


Attempt = Callable[[Contract], Plan]
Counts = tuple[int, int]


def best_partial(
    contract: Contract, site: Site, scene_version: str, refusal: PlacementError | None
) -> Plan | None:
    """A certified plan that falls as little short of a contract as is known, marked as partial.

    As many robots as fit; where none does, all of them at the nearest clearance to the one stated
    that can be held. Nothing is done about a clearance that was left open.

    Args:
        refusal: why the robots cannot all be placed; None where they can, but not certified.

    Returns:
        None where nothing that is certified was found, as where a cage needs more robots.
    """
    if isinstance(refusal, CageError) and refusal.needed is not None:
        return None
    full = with_defaults(contract, site.outlines, site.room)

    def attempt(smaller: Contract) -> Plan:
        if cut_short() and any(map(escape_proof, smaller.groups)):
            raise PlacementError(CUT_SHORT.strip())
        return make_plan(smaller, site, scene_version)

    with search_budget():
        fewer = None if refusal is None else _fewer(full, attempt)
        found = fewer or _nearer(contract, full, attempt, site)
        if found is None or found.partial is None or not cut_short():
            return found
        short = found.partial.model_copy(update={"sentence": found.partial.sentence + CUT_SHORT})
        return found.model_copy(update={"partial": short})


def _fewer(full: Contract, attempt: Attempt) -> Plan | None:
    """As many robots as fit, group after group."""
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
    """The contract with other numbers of robots in some groups; None where one has too few."""
    if any(n < (3 if contract.groups[k].relation == "cage" else 1) for k, n in robots.items()):
        return None
    return _changed(contract, {index: {"robots": count} for index, count in robots.items()})


def _changed(contract: Contract, updates: Mapping[int, Mapping[str, Any]]) -> Contract:
    """The contract with other values in some groups, by their index."""
    groups = enumerate(contract.groups)
    changed = tuple(g.model_copy(update=updates.get(index, {})) for index, g in groups)
    return contract.model_copy(update={"groups": changed})


def _parted(contract: Contract, pair: tuple[int, int], attempt: Attempt) -> Contract | None:
    """Fewer robots in two groups that crowd each other: most of those found that do not.

    The second group gives way, or the first, or both by the same share.
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
    """The counts with the fewest robots taken out that work, as far as halving finds them."""
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
    """What is short, given which groups are left, from 0."""
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


def _nearer(stated: Contract, full: Contract, attempt: Attempt, site: Site) -> Plan | None:
    """All robots at the greatest clearance that can be held, of the first group it helps.

    A ring that goes all the way round comes before a wider one of which the picture leaves a part.
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
    """The plan at the greatest clearance of a group that certifies and suits, found by halving."""
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
    """A share of the group's clearance; inside only the least one is in the way."""
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
