"""Which words go with which arrangement, by the thesaurus and by the training commands."""

from collections.abc import Sequence
from functools import cache
from importlib import resources

from .demands import word_list
from .tagging import ANY, in_use, stem, word_classes

CLASSES_OF = {
    "around": ("surround", "ring", "enclose", "enclosure"),
    "cage": ("enclose", "enclosure", "surround", "ring", "prevent", "nobody"),
    "inside": ("spread", "area"),
    "along": ("row",),
    "corners": ("corner",),
    "between": ("part",),
    "centre": ("gather", "middle"),
    "shape": ("form", "surround", "ring"),
}
DEMANDING = frozenset(
    {"gap", "face", "avoid", "wait", "motion", "each", "rest", "far", "near", "side", "figure"}
)
"""Classes whose words say more than an arrangement: a rule takes them, or the person is asked."""
NEUTRAL = ("place", "robot")
"""Classes of classes.yaml whose words go with any arrangement."""
WEIGHTY = word_list("weighty")
"""Small words on who, how many or whether: a rule takes them, or the person is asked."""
NEGATIONS = word_list("negations")
"""Words that say what must not happen, such as what a closed ring is to prevent."""


def weighs(word: str, classes: frozenset[str], relation: str) -> bool:
    """Return whether a word says more than the arrangement: "every", but not a cage's "nobody"."""
    if word not in WEIGHTY:
        return False
    says_it = (relation == "cage" and word in NEGATIONS) or (
        relation == "corners" and word in ("each", "every")
    )
    return not says_it and not classes & {*CLASSES_OF.get(relation, ())}


def may_command(words: Sequence[str], relation: str) -> list[bool]:
    """Return for each word whether it can be part of a command for an arrangement."""
    return [
        not word[0].isalpha()
        or word in fillers()
        or word in WEIGHTY
        or bool(classes & DEMANDING)
        or goes_with(word, classes, relation)
        for word, classes in zip(words, map(frozenset, word_classes(words)), strict=True)
    ]


def goes_with(word: str, classes: frozenset[str], relation: str) -> bool:
    """Return whether a word goes with an arrangement, by the thesaurus or the training commands."""
    if classes & {*CLASSES_OF.get(relation, ()), *NEUTRAL}:
        return True
    meanings = in_use().words.get(stem(word), frozenset())
    others = {c for r, named in CLASSES_OF.items() if r != relation for c in named}
    if relation in meanings or (ANY in meanings and not classes & others):
        return True
    return bool(meanings) and not classes & (others | DEMANDING)


@cache
def fillers() -> frozenset[str]:
    """Return the function words of fillers.txt, which say nothing about an arrangement."""
    text = resources.files(__package__ or "").joinpath("fillers.txt").read_text("utf-8")
    return frozenset(text.split())
