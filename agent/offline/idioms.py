"""Runs of small words that say one thing: "not lined up with the others", "in the upper left".

People phrase these in too many ways to list. A run is read as a whole: the kinds of words in it
decide what it says, and a word that is in none of the lists ends it.
"""

from functools import cache

from .phrases import HEADS, Words, phrase, several, table

LONGEST = 16
MIDDLE_OF_PICTURE = {
    ("leftmost", "topmost"): "upper_left",
    ("rightmost", "topmost"): "upper_right",
    ("bottommost", "leftmost"): "lower_left",
    ("bottommost", "rightmost"): "lower_right",
}


def difference(words: Words, at: int) -> tuple[str, int] | None:
    """Return the difference that a run of words describes, as a pick, and its length in words."""
    end = _run_end(words, at, _difference_words())
    while end > at:
        pick = _spoken_difference(set(words[at:end]), words[end - 1])
        if pick is not None:
            return pick, end - at
        end -= 1
    return None


def position(words: Words, at: int) -> tuple[str, int] | None:
    """Return the place in the picture that a run describes, as a pick, and its length in words."""
    end = _run_end(words, at, _position_words())
    lists = table()["positions"]
    while end > at:
        exactly = words[at] == "right" and end > at + 1  # right at the top
        here = set(words[at + exactly : end])
        sides = sorted(side for side, names in lists["sides"].items() if here & set(names))
        closed = words[end - 1] not in lists["open"]
        of_something = words[end : end + 1] == ["of"] and not several(words, end)
        if sides and closed and not of_something and not _also_beside(words, at, end):
            pick = sides[0] if len(sides) == 1 else MIDDLE_OF_PICTURE.get(tuple(sides[:2]))
            if len(sides) <= 2 and pick is not None:
                return pick, end - at
        end -= 1
    return None


def comparison(words: Words, at: int) -> int:
    """Return how many words compare with all the others: "than any of the other boats"."""
    if words[at] not in ("than", "compared"):
        return 0
    end = at + 1
    while end < min(len(words), at + LONGEST):
        found = phrase(words, end)
        plural = found is not None and found.kind in HEADS and found.plural
        if words[end] not in _difference_words() and not plural:
            break
        end += 1
    everything = set(words[at:end]) & set(table()["differences"]["compared"])
    return end - at if everything else 0


def _run_end(words: Words, at: int, known: frozenset[str]) -> int:
    end = at
    while end < min(len(words), at + LONGEST) and words[end] in known:
        end += 1
    return end


def _spoken_difference(here: set[str], last: str) -> str | None:
    """Return the pick for a set of words, or None if they describe no difference."""
    lists = {name: set(words) for name, words in table()["differences"].items()}
    if last in lists["open"]:
        return None
    negated = bool(here & lists["negation"])
    unlike = bool(here & lists["unlike"]) or (negated and bool(here & lists["like"]))
    if here & lists["crooked"] or (here & lists["turn"] and (unlike or negated)):
        return "askew"
    for aspect in ("colour", "size", "shape"):
        if here & lists[aspect] and unlike:
            return f"odd_{aspect}"
    if here & lists["alone"]:
        return "alone"
    if unlike:
        return "odd"
    return "alone" if here & lists["apart"] and here & lists["compared"] else None


def _also_beside(words: Words, at: int, end: int) -> bool:
    """Return whether a side of the thing is more likely meant than one of the picture."""
    lined = table()["positions"]["lined"]
    return bool({"side", "edge"} & set(words[at:end])) and bool(set(lined) & set(words[:at]))


@cache
def _difference_words() -> frozenset[str]:
    return frozenset(word for words in table()["differences"].values() for word in words)


@cache
def _position_words() -> frozenset[str]:
    lists = table()["positions"]
    sides = {word for words in lists["sides"].values() for word in words}
    return frozenset(sides | set(lists["fillers"]) | set(lists["open"]))
