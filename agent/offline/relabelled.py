"""Corrections of the tagger's labels where a few words leave no doubt about what they are.

A noun said again ("each facing the box") names the thing again; "the left half" alone and "the
left ones", once a left side was spoken of, are no things but parts of the arrangement.
"""

from collections.abc import Sequence

from .tagging import Token

DEFINITE = frozenset(("the", "this", "that", "said"))
NO_NOUN = frozenset(("one", "ones", "side", "sides", "left", "right", "top", "bottom", "middle"))
"""Last words of phrases for things that do not name the thing when they are said again."""
UNITS = frozenset(("px", "pixel", "pixels", "m", "metre", "metres", "meter", "meters", "cm", "mm"))
SIDES = frozenset(("left", "right", "top", "bottom", "upper", "lower"))
PARTS = frozenset(("half", "halves", "quarter"))
OPEN = frozenset(("open", "free", "clear", "unguarded", "empty"))
OF_TEAM = frozenset(("ones", "group", "row", "lot", "pair"))


def _is_length(words: Sequence[Token], k: int) -> bool:
    """Return whether a number with a unit stands at a word."""
    after = words[k + 1].text if k + 1 < len(words) else ""
    return words[k].text[0].isdigit() and after in UNITS


def _begins_with_from(words: Sequence[Token], labels: Sequence[str], k: int) -> bool:
    """Return whether the phrase for a thing at k follows on "from": "from the gate to the barn"."""
    first = k
    while first and labels[first - 1] == "thing":
        first -= 1
    return 0 < first < k and words[first - 1].text == "from"


def relabelled(words: Sequence[Token], labels: Sequence[str]) -> tuple[str, ...]:
    """Return the labels of an instruction's words, corrected."""
    found = list(labels)
    heads: set[str] = set()
    said: set[str] = set()
    for k, word in enumerate(words):
        text = word.text
        after = [w.text for w in words[k + 1 : k + 4]] + ["", "", ""]
        if text in DEFINITE and after[0] in heads and found[k] != "thing":
            found[k : k + 2] = ["thing", "thing"]
        elif after[0] in SIDES and after[2] != "of" and text in ("the", "its", "only"):
            parted = after[1] in PARTS or (after[1] in OF_TEAM and after[0] in said)
            opened = after[1] in OPEN or (after[1] in ("side", "end") and after[2] in OPEN)
            if parted or opened:
                until = k + 3 + (opened and after[1] not in OPEN)
                found[k:until] = ["demand"] * len(found[k:until])
        elif text == "to" and after[0] in DEFINITE and _begins_with_from(words, found, k):
            found[k] = "command"
        if found[k] == "thing" and _is_length(words, k):  # "the tree by 30 px"
            led = words[k - 1].text in ("by", "at", "about", ",", "of") if k else False
            found[k - led : k + 2] = ["demand"] * (2 + led)
        if found[k + 1 : k + 2] == ["thing"] and text in DEFINITE:
            found[k] = "thing"
        if text in SIDES:
            said.add(text)
        ends = found[k] == "thing" and found[k + 1 : k + 2] != ["thing"]
        if ends and k and found[k - 1] == "thing" and text.isalpha():
            heads.add(text)
        heads -= NO_NOUN
    return tuple(found)
