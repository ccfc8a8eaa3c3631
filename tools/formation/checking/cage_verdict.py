"""Whether a cage holds: the verdict, the measures and the finding.

The geometry proves or disproves it; here is what is run when, and what a model is told.
"""

import math

from ...geometry.cages.cages import QUICK, THOROUGH, Cage, cage
from ...geometry.curves import Curve
from ..placement.caging import escape_proof, walls_of
from .verdict import Audit, Escape, Part

WORDS = {"caged": "certified", "not certified": "not certified", "escape": "gets out"}
"""What the measure `escape_proof` says of each state; the worst one last."""
WORSE = tuple(WORDS.values())


def judge(part: Part, curve: Curve, audit: Audit) -> None:
    """Report whether the target is caged, and find fault if it must be and is not.

    The disc test is always run. Where it does not certify, up to 300 robots have the
    configuration space flooded: all levels for an escape-proof closure (up to about a second of
    CPU time for ten robots), the two coarsest for a ring (under a tenth).
    """
    levels = THOROUGH if escape_proof(part.group) else QUICK
    found = cage(
        part.outline.filled,
        part.points,
        part.radius,
        walls=walls_of(part.group, part.site.room),
        levels=levels,
    )
    before, state = audit.measures.get("escape_proof"), WORDS[found.state]
    if before is None or WORSE.index(state) > WORSE.index(str(before)):
        audit.measures["escape_proof"] = state
    if found.test is not None and audit.measures.get("escape_test") != "configuration space":
        audit.measures["escape_test"] = found.test
    if audit.measures["escape_proof"] != WORDS["caged"]:
        audit.measures.pop("escape_test", None)
    if found.path is not None and audit.escape is None:
        poses = tuple((float(x), float(y), float(turn)) for x, y, turn in found.path.round(4))
        audit.escape = Escape(target=part.group.targets[0], poses=poses)
    if escape_proof(part.group) and found.state != "caged":
        gap, limit = found.widest_gap or 0.0, found.inscribed_diameter
        audit.whole("not_caged", gap, limit, _sentence(part, curve, found))


def _sentence(part: Part, curve: Curve, found: Cage) -> str:
    name, limit = part.group.targets[0], found.inscribed_diameter
    said = (
        f"{name} can get out between the robots, on a way that was checked"
        if found.state == "escape"
        else f"It is not certified that {name} cannot get out"
    )
    if found.widest_between is not None and found.widest_gap is not None:
        i, j = sorted(k + part.first + 1 for k in found.widest_between)
        said += f": robots {i} and {j} leave a gap of {found.widest_gap:.1f} px"
    enough = math.floor(curve.whole_length / (limit + 2 * part.radius)) + 1
    even = (
        f"{max(enough, 3)} robots evenly on the ring do"
        if curve.closed
        else "the picture's border cuts the ring of this clearance, so a nearer one is needed"
    )
    return (
        f"{said}. A ring all of whose gaps are below {limit:.1f} px certainly holds it: {even}. "
        "Where the positions are left out, fewer may be placed."
    )
