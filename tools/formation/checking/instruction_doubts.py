"""Compares the plain facts of an instruction with the contract that is to carry it out.

Only words that can hardly mean anything else count. A doubt is a question to the model, which may
answer that the contract is right.
"""

import re
from collections.abc import Iterator, Sequence

from ..contract import Contract, Group, Relation
from ..quantities import Quantity, quantities_in
from ..units import length_text

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
"""A pattern, the word to quote, and the relations it can mean."""
ROBOTS = re.compile(r"\W+(?:[\w-]+\W+){0,2}?(?:robots?|bots?|agents?|drones?|rovers?)\b")
SIDE = r"(?:left|right|top|bottom|upper|lower|north|south|east|west)(?:ern)?(?:[ -]hand)?"
WEIGHTY: tuple[tuple[str, str], ...] = (
    (r"\b(?:all|each|noses?|cameras?|backs?|fronts?)\b[^.;]{0,20}\b(?:facing|face|outwards?|inwards?)"
     r"\b|\bfacing (?:out|in|away|outwards?|inwards?|it)\b", "heading"),
    (r"\b(?:leave|leaving|with)\b(?! no)[^.;]{0,20}\b(?:gap|opening|doorway|entrance|exit)\b",
     "opening"),
    (rf"\b(?:along|on|at|down|beside|leave|leaving) (?:the |its )?{SIDE} (?:side|edge|flank)\b",
     "side"),
    (r"\b(?:clear of|keep off|stay off|hands off|keep away from|without touching)\b", "keep_out"),
    (r"\b(?:each|both|every one) of (?:the|these|those)\b(?! robots|[^.;,]{0,30}corners)",
     "targets"),
    (r"\b(?:all|everything|anything|everyone) (?:but|except)\b|\bexcept\b", "sides"),
)  # fmt: skip
"""A pattern of words that a contract has to account for, and the part of it that does."""
ACROSS = re.compile(r"\s*(?:across|wide|in diameter)\b")
SAME = 0.05
"""Share by which a length in the contract may differ from the one in the instruction."""


def doubts(
    instruction: str,
    contract: Contract,
    *,
    counted: bool = False,
    measured: bool = False,
    scale: float | None = None,
) -> list[str]:
    """Return where a contract contradicts the plain words of an instruction, one clause each.

    Args:
        instruction: the person's words; words in languages other than English are ignored.
        contract: the contract as a model stated it, in px.
        counted: whether the person gave the number of robots separately from the words.
        measured: whether the person gave lengths separately from the words.
        scale: metres per pixel; without it only lengths in px are checked.
    """
    text = " ".join(instruction.split())
    quantities = quantities_in(text)
    text = text.lower()
    return [
        *(() if counted else _count_doubts(text, quantities, contract)),
        *_relation_doubts(text, contract),
        *(() if measured else _length_doubts(text, quantities, contract, scale)),
        *_weight_doubts(text, contract),
    ]


def overruled(
    instruction: str, contract: Contract, *, counted: bool, measured: bool, scale: float | None
) -> list[str]:
    """Return a note, if needed, that what the person gave separately overrides the words.

    For the arguments see `doubts`.
    """
    left = doubts(instruction, contract, counted=counted, measured=measured, scale=scale)
    said = [d for d in doubts(instruction, contract, scale=scale) if d not in left]
    return [f"What was given beside the words holds: {'; '.join(said)}."] if said else []


def _count_doubts(text: str, quantities: Sequence[Quantity], contract: Contract) -> Iterator[str]:
    counted = [q.whole for q in quantities if q.whole and ROBOTS.match(text, q.end)]
    found = [n for n in counted if n > 1]  # "one robot at each corner" counts nothing
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


def _weight_doubts(text: str, contract: Contract) -> Iterator[str]:
    for pattern, part in WEIGHTY:
        found = re.search(pattern, text)
        if found and not _answers(contract, part):
            yield f"the instruction says {found[0]!r}, but no group has a {part} for it"


def _answers(contract: Contract, part: str) -> bool:
    """Return whether a contract specifies a part."""
    if part == "keep_out":
        return bool(contract.keep_out)
    if part == "targets":
        return len(contract.target_ids) > 1
    fields = {
        "heading": ("heading", "facing"),
        "opening": ("opening", "opening_towards", "sides", "shape"),
        "side": ("side", "sides", "edges", "facing", "opening_towards", "shape"),
        "sides": ("side", "sides", "opening", "opening_towards", "edges"),
    }[part]
    return any(getattr(g, name) is not None for g in contract.groups for name in fields)


def _length_doubts(
    text: str, quantities: Sequence[Quantity], contract: Contract, scale: float | None
) -> Iterator[str]:
    """Yield doubts about lengths in the words that the contract lacks.

    Nothing is checked if any group draws a shape, as shapes have lengths of their own.
    """
    if any(group.relation == "shape" for group in contract.groups):
        return
    radius = contract.robot_radius
    stated = [radius, 2 * radius, *(n for g in contract.groups for n in _lengths(g))]
    for quantity in quantities:
        named = quantity.px(scale) if quantity.is_length else None
        if named is None or named[0] <= 0:
            continue
        if across := ACROSS.match(text, quantity.end):
            if abs(2 * radius - named[0]) > SAME * named[0]:
                has = length_text(radius, scale)
                said = f"{quantity.wording}{across[0]}"
                yield f"the instruction says {said}, but robot_radius is {has}"
        elif not all(any(abs(px - s) <= SAME * px for s in stated) for px in named):
            yield (f"the instruction names {quantity.wording}, which is no length of the contract")


def _lengths(group: Group) -> Iterator[float]:
    clearance = group.clearance or ()
    yield from clearance
    if clearance:
        yield sum(clearance) / 2
    named = (group.min_spacing, group.max_gap, group.pitch, group.radius, group.opening)
    for length in named:
        if length is not None:
            yield from (length, 2 * length)
