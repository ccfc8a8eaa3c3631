"""The plain facts of an instruction, held against the contract that is to carry it out.

Only words that hardly mean anything else count, and none that stand beside a negation: a doubt is
a question to the model, which may answer that the contract is right.
"""

import re
from collections.abc import Iterator, Sequence

from ..contract import Contract, Relation
from ..named_lengths import LENGTH, NUMBERS, named_lengths
from ..units import LENGTHS, length_text

NEGATION = re.compile(r"(?:\b(?:not|no|never|without|except|instead of)|n't)(?:\W+\w+){0,3}\W*\Z")
PLAIN: tuple[tuple[str, str, frozenset[Relation]], ...] = (
    (
        r"\b(?:at|on|in|off|each|every|all|four|its|of the)\b[^.;,]{0,20}\bcorners?\b"
        r"(?! of the (?:picture|photo|image|room|lot|field))",
        "corners",
        frozenset({"corners"}),
    ),
    (r"\b(?:fill|infill)\b(?! in\b)", "fill", frozenset({"inside"})),
    (r"\b(?:cage|caging|imprison|lock in)\b", "cage", frozenset({"cage"})),
    (r"\b(?:surround|encircle)\b", "surround", frozenset({"around", "cage", "corners"})),
)
"""A pattern, the word to quote, and the relations that can be meant by it."""
COUNT = re.compile(rf"\b(\d+|{'|'.join(NUMBERS)})\W+(?:\w+\W+)?(?:robots?|bots?|agents?|drones?)\b")
SAME = 0.05
"""Share by which a length of the contract may differ from the one named."""


def doubts(
    instruction: str, contract: Contract, *, counted: bool = False, scale: float | None = None
) -> list[str]:
    """Where a contract says something else than the plain words; each one clause.

    Args:
        instruction: in the person's words; words of other languages count nothing.
        contract: as a model stated it, in px.
        counted: whether the person gave the number of robots apart from the words.
        scale: metres per pixel. Where there is one, lengths can be stated in either unit, so that
            those the words name are looked for; None leaves them alone.
    """
    text = " ".join(instruction.lower().split())
    lengths = () if scale is None else _length_doubts(text, contract, scale)
    return [
        *(() if counted else _count_doubts(text, contract)),
        *_relation_doubts(text, contract),
        *lengths,
    ]


def _count_doubts(text: str, contract: Contract) -> Iterator[str]:
    counted = COUNT.findall(LENGTH.sub(",", text))  # "0.4 m robots" are not four
    wording = [NUMBERS.index(n) if n in NUMBERS else int(n) for n in counted]
    found = [n for n in wording if n > 1]  # "one robot at each corner" counts nothing
    if found and contract.robots not in {*found, sum(found)}:
        counts = " and ".join(map(str, found))
        yield f"the instruction speaks of {counts} robots, the contract has {contract.robots}"


def _relation_doubts(text: str, contract: Contract) -> Iterator[str]:
    used = {group.relation for group in contract.groups}
    for pattern, word, meant in PLAIN:
        plain = [m for m in re.finditer(pattern, text) if not NEGATION.search(text[: m.start()])]
        if plain and not used & meant:
            names = " or ".join(sorted(meant))
            yield f"the instruction says {word!r}, but no group has the relation {names}"


def _length_doubts(text: str, contract: Contract, scale: float) -> Iterator[str]:
    """Lengths of the words that the contract has not; forms have lengths of their own."""
    drawn = any(group.relation == "shape" for group in contract.groups)
    stated = [
        length
        for g in contract.groups
        for length in (*(g.clearance or ()), *(getattr(g, name) for name in LENGTHS))
        if length is not None
    ]
    stated += [sum(g.clearance) / 2 for g in contract.groups if g.clearance is not None]
    for named in named_lengths(text):
        px = named.px(scale)
        if named.of in ("across", "radius"):
            wanted = px / 2 if named.of == "across" else px
            rings = [g.radius for g in contract.groups if g.radius is not None]
            if not _is_near(wanted, [contract.robot_radius, *rings]):
                has = length_text(contract.robot_radius, scale)
                yield f"the instruction says {named.wording} {named.of}, but robot_radius is {has}"
        elif named.of != "something" and not drawn and not _is_near(px, stated):
            yield f"the instruction names {named.wording}, which is no length of the contract"


def _is_near(length: float, among: Sequence[float]) -> bool:
    return any(abs(length - other) <= SAME * length for other in among)
