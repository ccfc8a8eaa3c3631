"""The plain facts of an instruction, held against the contract that is to carry it out.

Only words that hardly mean anything else count, and none that stand beside a negation: a doubt is
a question to the model, which may answer that the contract is right.
"""

import re
from collections.abc import Iterator

from .contract import Contract, Relation

NUMBERS = (
    *("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"),
    *("eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen"),
    *("nineteen", "twenty"),
)
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


def doubts(instruction: str, contract: Contract, *, counted: bool = False) -> list[str]:
    """Where a contract says something else than the plain words; each one clause.

    Args:
        instruction: in the person's words; words of other languages count nothing.
        contract: as a model stated it.
        counted: whether the person gave the number of robots apart from the words.
    """
    text = " ".join(instruction.lower().split())
    return [*(() if counted else _count(text, contract)), *_relations(text, contract)]


def _count(text: str, contract: Contract) -> Iterator[str]:
    said = [NUMBERS.index(n) if n in NUMBERS else int(n) for n in COUNT.findall(text)]
    found = [n for n in said if n > 1]  # "one robot at each corner" counts nothing
    if found and contract.robots not in {*found, sum(found)}:
        counts = " and ".join(map(str, found))
        yield f"the instruction speaks of {counts} robots, the contract has {contract.robots}"


def _relations(text: str, contract: Contract) -> Iterator[str]:
    used = {group.relation for group in contract.groups}
    for pattern, word, meant in PLAIN:
        plain = [m for m in re.finditer(pattern, text) if not NEGATION.search(text[: m.start()])]
        if plain and not used & meant:
            names = " or ".join(sorted(meant))
            yield f"the instruction says {word!r}, but no group has the relation {names}"
