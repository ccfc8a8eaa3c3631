"""Which words go with which arrangement: by the thesaurus, and by commands it was trained on."""

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
"""Classes whose words say more than an arrangement: a rule takes them, or they are asked."""
NEUTRAL = ("place", "robot")
"""Classes of classes.yaml whose words say an arrangement, or none."""
WEIGHTY = word_list("weighty")
"""Small words that change who, how many or whether: a rule takes them, or they are asked."""
NEGATIONS = word_list("negations")
"""What a closed ring is to prevent is said with these."""


def weighs(word: str, classes: frozenset[str], relation: str) -> bool:
    """Whether a word changes more than the arrangement says: "every", but of no cage "nobody"."""
    if word not in WEIGHTY:
        return False
    says_it = (relation == "cage" and word in NEGATIONS) or (
        relation == "corners" and word in ("each", "every")
    )
    return not says_it and not classes & {*CLASSES_OF.get(relation, ())}


def may_command(words: Sequence[str], relation: str) -> list[bool]:
    """For each word whether it can be part of a command for an arrangement."""
    return [
        not word[0].isalpha()
        or word in fillers()
        or word in WEIGHTY
        or bool(classes & DEMANDING)
        or goes_with(word, classes, relation)
        for word, classes in zip(words, map(frozenset, word_classes(words)), strict=True)
    ]


def goes_with(word: str, classes: frozenset[str], relation: str) -> bool:
    """Whether a word goes with an arrangement: by the thesaurus or in other commands."""
    if classes & {*CLASSES_OF.get(relation, ()), *NEUTRAL}:
        return True
    meanings = in_use().words.get(stem(word), frozenset())
    others = {c for r, named in CLASSES_OF.items() if r != relation for c in named}
    if relation in meanings or (ANY in meanings and not classes & others):
        return True
    return bool(meanings) and not classes & (others | DEMANDING)


@cache
def fillers() -> frozenset[str]:
    """Function words that say nothing of an arrangement, fillers.txt."""
    text = resources.files(__package__ or "").joinpath("fillers.txt").read_text("utf-8")
    return frozenset(text.split())
