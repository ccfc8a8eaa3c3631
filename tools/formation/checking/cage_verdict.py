"""The verdict, measures and finding on whether a cage holds.

The geometry proves or disproves it; this module decides which tests to run and what to report.
"""

import math

from ...geometry.cages.cages import QUICK, THOROUGH, cage
from ...geometry.curves import Curve
from ..placement.caging import escape_proof, walls_of
from .verdict import Audit, Escape, Part

WORDS = {"caged": "certified", "not certified": "not certified", "escape": "gets out"}
"""The value of the measure `escape_proof` for each state, the worst one last."""
WORSE = tuple(WORDS.values())


def judge(part: Part, curve: Curve, audit: Audit) -> None:
    """Report whether the target is caged, with a finding if it has to be and is not.

    The disc test is always run. If it does not certify, the configuration space is flooded for up
    to 300 robots: on all levels for an escape-proof closure (up to about a second of CPU time for
    ten robots), on the two coarsest for a ring (under a tenth).
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
        between = () if found.widest_gap is None else found.widest_between or ()
        enough = math.floor(curve.whole_length / (limit + 2 * part.radius)) + 1
        audit.find(
            "gets_out" if found.state == "escape" else "not_caged",
            gap,
            limit,
            others=[k + part.first for k in between],
            about=part.group.targets[0],
            needed=max(enough, 3) if curve.closed else None,
        )
