"""Reader of the things that an instruction refers to.

What is understood becomes a query that is decided on measures. What is not is recorded, so that
the planner can say so.
"""

import re
from collections.abc import Sequence

from .descriptions import STRANGERS, Description, Reference
from .phrases import HEADS, STOPS, Words, phrase, several, table


def described(phrases: Sequence[str]) -> tuple[Reference, ...]:
    """Return the things that English noun phrases refer to, without repeated mentions.

    What is not understood of a phrase is among the `unknown` words of its thing.
    """
    found: list[Reference] = []
    for phrase_ in phrases:
        words = _split_words(phrase_)
        if words and words[0] not in table()["determiners"]:
            words = ["the", *words[words[0] in ("a", "an") :]]
        found += _described_all(words)
    return _without_repeats(found)


def _described_all(words: Words) -> list[Reference]:
    found: list[Reference] = []
    at, left = 0, list[str]()
    while at < len(words):
        read = _read_reference(words, at)
        if read is None or (found and read[0].strange):
            left.append(words[at])
            at += 1
        else:
            found.append(read[0])
            at = read[1]
    rest = [w for w in left if w not in STOPS and w not in table()["follow"]]
    if found and rest:
        found[-1].unknown.append(" ".join(rest))
    return found


def _split_words(text: str) -> list[str]:
    plain = text.lower().replace("-", " ").replace("\N{RIGHT SINGLE QUOTATION MARK}", "'")
    return re.findall(r"[0-9]+(?:[.,][0-9]+)+[a-z]*|[a-z0-9]+(?:'[a-z0-9]+)*|[,.;:!?+*%]", plain)


def _read_reference(words: Words, at: int) -> tuple[Reference, int] | None:
    """Return the thing, known or not, whose phrase begins at a word, and the end of the phrase."""
    if words[at] not in table()["determiners"] or words[at + 1 : at + 2] == []:
        return None
    if words[at + 1] in table()["verbs"] or _is_about_a_part(words, at + 1):
        return None
    return _described(words, at) or _stranger(words, at)


def _described(words: Words, at: int) -> tuple[Reference, int] | None:
    """Return the thing whose description begins with a determiner, and the description's end."""
    description = Description(words, at + 1)
    thing, end = description.thing, description.at
    if thing.strange or _is_robots(words, at, end):
        return None
    before = words[max(at - 2, 0) : at]
    if len(before) == 2 and before[1] == "of" and not _may_own(before[0]):
        thing.refused = thing.refused or f"{before[0]} of"
    blockers = [w for w in before if w in table()["blockers"]]
    part = description.closed and _part_follows(words, end)
    if blockers and not part:
        thing.refused = blockers[0]
    if _or_another(words, end):
        thing.refused = thing.refused or " ".join(words[end : end + 2])  # the red or blue one
    if description.closed and not part:
        thing.refused = thing.refused or " ".join(words[end : end + 1])  # the coin's shadow
    trailing = 0 if description.closed else _trailing(words, end)
    if trailing:
        clause = words[end : end + trailing]
        thing.unknown.append(" ".join(clause))
        excludes = set(clause) & {*table()["blockers"], *table()["differences"]["negation"]}
        if words[end] not in table()["clauses"] or excludes:
            thing.called = "" if thing.noun or excludes else " ".join(clause)  # the red fork
            thing.refused = thing.refused or " ".join(clause)  # the coin box is no coin
    if not thing.noun and words[end - 1] in table()["places"]:
        thing.refused = thing.refused or words[end - 1]  # the top left corner
    if thing.noun == "any" and not thing.whole_query and _from_another(words, end):
        thing.refused = thing.refused or " ".join(words[end : end + 3])
    thing.wording = " ".join(words[at : end + trailing])
    return thing, end + trailing


def _or_another(words: Words, at: int) -> bool:
    """Return whether a second thing without article follows: "or blue heart", "and star"."""
    if words[at : at + 1] not in (["or"], ["and"], ["nor"], ["plus"], [","]):
        return False
    second = phrase(words, at + 1) if at + 1 < len(words) else None
    if second is None or second.kind in ("relations", "skip", "partitive"):
        return False
    if words[at] == ",":
        noun = phrase(words, at + 1 + second.length) if second.kind == "colours" else None
        return noun is not None and noun.kind in HEADS and noun.value != "any"
    after = words[at + 1 + second.length : at + 2 + second.length]
    return not after or after[0] not in ("it", "them", *table()["determiners"])  # and circle it


def _part_follows(words: Words, at: int) -> bool:
    """Return whether a part follows an owner: left side, very centre."""
    for k, word in enumerate(words[at : at + 4], start=at):
        found = phrase(words, k)
        if found is not None and found.kind in HEADS:
            return False
        if word in table()["parts"]:
            return _ends_there(words, k + 1)
        if word in STOPS or word in table()["determiners"]:
            return False
    return False


def _ends_there(words: Words, at: int) -> bool:
    """Return whether no other noun follows: "left side", not "left neighbour"."""
    lists = table()
    while at < len(words) and (words[at] in lists["parts"] or words[at] == "hand"):
        at += 1
    ends = (*STOPS, *lists["follow"], *lists["ends"], *lists["at"])
    return at >= len(words) or words[at] in ends or words[at].isdecimal()


def _from_another(words: Words, at: int) -> bool:
    """Return whether a place relative to a thing named before follows: "to its left"."""
    relation = phrase(words, at)
    if relation is not None and relation.kind == "relations":
        return words[at + relation.length : at + relation.length + 1] in (["it"], ["them"])
    return words[at : at + 1] in (["to"], ["on"]) and words[at + 1 : at + 2] in (["its"], ["their"])


def _stranger(words: Words, at: int) -> tuple[Reference, int] | None:
    """Return a thing of an unknown kind: "the dog", "the parrot nearest to the ring"."""
    lists = table()
    known = (*lists["follow"], *lists["parts"], *lists["blockers"], *STOPS)
    end = at + 1
    while end < len(words) and words[end] not in known:
        if phrase(words, end) is not None and end > at + 1:
            break
        end += 1
    name = " ".join(words[at + 1 : end])
    if not name or _is_robots(words, at, end) or end - at > STRANGERS + 1:
        return None
    thing = Reference(wording=" ".join(words[at:end]), called=name, refused=name)
    relation = phrase(words, end)
    if relation is not None and relation.kind == "relations":
        after = end + relation.length
        if after < len(words) and words[after] in lists["determiners"]:
            end = Description(words, after + 1, nested=True).at
    return thing, end


def _is_about_a_part(words: Words, at: int) -> bool:
    """Return whether words continue like "left side of", "four corners of", "very middle of"."""
    for k in range(at, min(at + 4, len(words) - 1)):
        found = phrase(words, k)
        if words[k] in STOPS or (found is not None and found.kind in HEADS):
            return False
        if words[k] in table()["parts"] and words[k + 1] == "of":
            if several(words, k + 1):
                return False
            picture = phrase(words, k + 1)
            return picture is None or picture.kind != "skip"
    return False


def _is_robots(words: Words, at: int, end: int) -> bool:
    """Return whether words are for the robots themselves, as in "the six robots"."""
    return any(w.rstrip("s") in table()["robots"] for w in words[at : end + 1])


def _may_own(word: str) -> bool:
    """Return whether "WORD of the thing" is about where robots stand, not another thing."""
    return word in table()["parts"] or word in table()["owned"]


def _trailing(words: Words, at: int) -> int:
    """Return how many words after a description still describe the thing but are not understood."""
    lists = table()
    if at >= len(words) or words[at] in STOPS or words[at].isdecimal():
        return 0
    word, after = words[at], words[at + 1 : at + 2]
    clause = word in lists["clauses"]
    if word == "with" or word in lists["at"]:
        clause = bool(after) and after[0] in lists["describing"]
        clause = clause and not set(words[at + 2 : at + 4]) & set(lists["parts"])
        clause = clause and not _is_robots(words, at + 2, at + 4)
        if not clause:
            return 0
    if word == "than":
        clause = bool(after) and after[0] in lists["determiners"]  # larger than the quarter
    if not clause and (word in lists["follow"] or word in lists["counts"]):
        return 0
    count = 1
    while at + count < len(words) and words[at + count] not in STOPS:
        if words[at + count] in lists["ends"]:
            break
        count += 1
    return count


def _without_repeats(things: Sequence[Reference]) -> tuple[Reference, ...]:
    """Return the things without repeated mentions: "that thing", "the coin" again."""
    telling = [t for t in things if t.query or t.unknown or t.refused or t.noun != "any"]
    kept: list[Reference] = []
    for thing in telling or things:
        again = not (thing.unknown or thing.refused) and any(
            thing.noun in ("any", other.noun)
            and all(other.query.get(name) == value for name, value in thing.query.items())
            for other in kept
        )
        if not again:
            kept.append(thing)
    return tuple(kept)
