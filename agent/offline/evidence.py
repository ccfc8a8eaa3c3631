"""Evidence for an arrangement from the words right before a thing.

"Around the helipad" means no row and nothing inside it, however unlike the training sentences.
"""

import re
from collections.abc import Mapping, Sequence

from .demand_fields import LENGTHS
from .demands import Item, demands_in
from .tagging import Tagging, Token, in_use, word_classes

UNLIKELY, LESS_LIKELY = 0.002, 0.3
"""Factors on arrangements that the words rule out, and on "several" and "ask"."""
LIKELY = 0.1
"""Probability added to the arrangement that the words usually mean."""
ANY = frozenset(("several", "ask"))
TIPS = r"(?:corners?|vertex|vertices|tips?|points|apex(?:es)?|apices|peaks|cusps?)"
EVIDENCE = tuple(
    (re.compile(rf"(?<!\S)(?:{words})(?!\S)"), tuple(meanings.split()))
    for words, meanings in (
        (rf"(?:on|at|by|near|in|per|for|to|each|every|all) (?:\S+ ){{0,3}}{TIPS}", "corners"),
        (r"between (?:<t>|both|the <n>|these <n>)", "between"),
        (r"(?:around|round|about|encircl\S+|surround\S*|circling|enclosing) "
         r"(?:it|<t>|(?:the|this|that|my|our) \S+)",
         "around cage shape along"),
        (r"<t> (?:\S+ ){0,3}(?:around|round) it", "around cage shape along"),
        (r"(?:in|inside|into|within|throughout|upon|aboard) (?:it|<t>)",
         "inside centre shape"),
        (r"(?:on|onto|across|over|all over) (?:it|<t>)", "inside centre shape along"),
        (r"(?:alongside|next to|along|parallel to|in front of|behind|beneath|below|above) "
         r"(?:it|<t>)", "along shape between"),
    )
)  # fmt: skip
"""Words before a thing, and the arrangements that they can mean, the usual one first."""
ENCLOSING = ("enclose", "enclosure", "prevent", "surround")
"""Classes of verbs to which a following "in" or "on" belongs: "fence in", "close in on"."""


def meaning_of(words: Sequence[Token], tagging: Tagging, items: Sequence[Item]) -> dict[str, float]:
    """Return probabilities of arrangements, with or without words about lengths, as is surer."""
    lengths = [d for d in demands_in(items) if d.sets in (*LENGTHS, "robot_diameter", "apart")]
    spans = [(items[d.first].start, items[d.last - 1].end) for d in lengths]
    labels = [
        "length" if any(a <= word.start < b for a, b in spans) else label
        for word, label in zip(words, tagging.labels, strict=True)
    ]
    bare = in_use().meaning([w.text for w in words], labels)
    meaning = max(bare, tagging.meaning, key=lambda m: max(m.values()))
    return weighed(meaning, items)


def weighed(meaning: Mapping[str, float], items: Sequence[Item]) -> dict[str, float]:
    """Return probabilities, lower for arrangements that the words before the thing rule out."""
    line = " ".join(i.symbol for i in items)
    found = dict(meaning)
    for pattern, fitting in EVIDENCE:
        match = pattern.search(line)
        if match is None or _of_verb(line[: match.start()], match[0]):
            continue
        others = {m: LESS_LIKELY if m in ANY else UNLIKELY for m in found}
        found = {m: p * (1.0 if m in fitting else others[m]) for m, p in found.items()}
        found[fitting[0]] += LIKELY
        break
    total = sum(found.values())
    return {m: p / total for m, p in found.items()}


def _of_verb(before: str, words: str) -> bool:
    """Return whether a preposition belongs to the verb before it."""
    near = words.split()[0] in ("in", "on", "over", "about", "round")
    verbs = word_classes(before.split()[-2:])
    return near and any({*ENCLOSING} & {*classes} for classes in verbs)
