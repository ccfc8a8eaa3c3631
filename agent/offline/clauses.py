"""A line said about a plan, split into clauses so that a frame takes every phrase of each.

The words before may complete a clause: "left. no wait, right", "and robot 3 too".
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from . import (
    followup_edits,
    followup_last,
    followup_moves,
    followup_parts,
    followup_sides,
    followup_teams,
    followup_turns,
)
from .followup_chunks import Chunk
from .followup_edits import Effect, Effects, Utterance, ask
from .followup_frames import Frame, Slots, frames
from .followup_things import resolved
from .followup_words import chunks_of, rules
from .spelling import spelled
from .standing import Standing

NO_EDITS = ("ask", "refuse", "undo", "go", "hold", "query", "talk", "stay", "rest")
"""Kinds of effects that do not change a plan."""
OF_A_TEAM = ("add", "remove", "side", "sides", "opening", "count", "arrange")
"""Kinds of edits for one group; where there are several, it is named or the person is asked."""
OF_TEAMS = (
    *("out", "in", "rotate", "mirror", "shift", "scale", "distance", "spacing", "heading"),
    *("close", "open", "escape-proof"),
)
"""Kinds of edits that apply to all groups where none is named."""
TALK = ("did", "why", "help", "status", "thanks", "hello")
AMOUNTS = ("px", "angle", "share", "much", "num", "m")
REPLACED = (
    *("robots", "dir", "side", "flank", "radial", "thing", "other", "there", "spin", "axis"),
    *("portion", "scale", "apart", "inward", "point", "relation"),
)
"""Kinds of phrases that can replace others of the same kind."""
LEADING = frozenset(
    ("no", "neg", "correction", "yes", "filler", "sep", "thanks", "hello", "instead", "certq")
)
PURE = frozenset(("filler", "sep", "yes", "thanks", "hello", "correction"))
SLIGHT = PURE | {
    *("move", "make", "it", "team", "leavegap", "about", "towards", "side_of"),
    *("instead", "robotword"),
}
"""Kinds of phrases that say nothing by themselves."""
OPENERS = r"^(?:(?:so|and|ok|okay|hm+|but|now|well|please|hey|hi|no|yes|then)\b[ ,.]*)+"


@dataclass(frozen=True)
class Clause:
    """Phrases that one frame takes, the name of the frame, and its effects."""

    chunks: tuple[Chunk, ...]
    frame: str
    effects: tuple[Effect, ...]

    @property
    def settled(self) -> bool:
        """Whether the clause neither asks nor refuses."""
        return not any(e["kind"] in ("ask", "refuse") for e in self.effects)


class Line:
    """One line of the person's words.

    Attributes:
        words: the line with typos fixed.
        chunks: its phrases, without those that lead into it.
        led: kinds and words of the leading phrases: "no", "ok", "and".
        excepted: robots that it excepts: "all but robot 3".
    """

    def __init__(self, words: str, standing: Standing) -> None:
        self.words, self.standing = spelled(words), standing
        self.led = self.asking = ""
        self.excepted: tuple[int, ...] = ()
        chunks = _commanding(chunks_of(self.words, standing))
        found = [resolved(c, self.words, standing) for c in chunks]
        while len(found) > 1 and (_is_pure(found[-1]) or is_empty(found[-1])):
            found.pop()  # "the lower one, i mean"
        if any({"stay", "except"} & set(c.kinds) for c in found) and not self._leaving(found):
            found = [_as_team(c) if "rest" in c.kinds else c for c in found]
        self.chunks = self._without_excepted(self._without_contrast(self._without_lead(found)))

    def _leaving(self, chunks: Sequence[Chunk]) -> bool:
        """Return whether robots leave, or the others are said to stay."""
        at = [k for k, c in enumerate(chunks) if "rest" in c.kinds]
        stays = any("stay" in c.kinds for k in at for c in chunks[k + 1 : k + 3])
        return stays or any({"leave", "remove"} & set(c.kinds) for c in chunks)

    @property
    def adds(self) -> bool:
        """Whether the line adds to the last change, even after a "no": "no, further still"."""
        return re.search(r"\b(?:still|even|yet)\b", self.words, re.IGNORECASE) is not None

    @property
    def denies(self) -> bool:
        """Whether the line begins with "no" or the like."""
        return "no " in self.led or "correction" in self.led

    def words_of(self, chunks: Sequence[Chunk]) -> str:
        """Return the words of some phrases, without surrounding punctuation."""
        said = self.words[chunks[0].start : chunks[-1].end] if chunks else ""
        return " ".join(said.split()).strip(" ,.;!?")

    def read(self) -> list[Clause] | None:
        """Return the clauses of the line; None where phrases are left over."""
        return self._after_right() or self._corrected() or self.clauses(self.chunks)

    def _after_right(self) -> list[Clause] | None:
        """Return the clauses after a leading "right,"; None if there is none, or only an amount."""
        if len(self.chunks) < 3 or not {"yes", "dir"} <= set(self.chunks[0].kinds):
            return None
        if "sep" not in self.chunks[1].kinds:
            return None
        clauses = self.clauses(self.chunks[2:])
        if not clauses or not all(c.settled for c in clauses):
            return None
        return clauses if clauses[0].frame not in ("more", "bare", "less") else None

    def clauses(
        self, chunks: Sequence[Chunk], before: tuple[Effect, ...] = ()
    ) -> list[Clause] | None:
        """Return the fewest clauses that frames take whole, after those with effects `before`."""
        first = next((k for k, c in enumerate(chunks) if not _is_pure(c)), len(chunks))
        chunks = chunks[first:]
        if all(map(is_empty, chunks)):
            return []
        ends = [k for k, c in enumerate(chunks) if k and "sep" in c.kinds] + [len(chunks)]
        for end in reversed(ends):
            clause = self._framed(chunks[:end], before)
            if clause is None:
                continue
            rest = self.clauses(chunks[end:], (*before, *clause.effects))
            if rest is not None:
                return [clause, *rest]
        return None

    def _without_lead(self, chunks: Sequence[Chunk]) -> list[Chunk]:
        for k, chunk in enumerate(chunks):
            marks = [m for m in ("no", "correction", "yes", "thanks", "hello") if m in chunk.kinds]
            leads = {"no", "correction", "yes", "sep", "filler"} & set(chunk.kinds)
            text = self.words[chunk.start : chunk.end].lower()
            named = "yes " in self.led and "there" in chunk.kinds and not self.standing.pointed
            agreed = named and "sep" in chunks[min(k + 1, len(chunks) - 1)].kinds
            if not (agreed or (leads and set(chunk.kinds) <= LEADING)) or text == "also":
                return list(chunks[k:])
            self.led += "".join(f"{m} " for m in (*marks, text))
        return []

    def _without_excepted(self, chunks: list[Chunk]) -> list[Chunk]:
        for k, chunk in enumerate(chunks[:-1]):
            if "except" in chunk.kinds and "robots" in chunks[k + 1].kinds:
                self.excepted = tuple(chunks[k + 1].kinds["robots"])
                return [*chunks[:k], *chunks[k + 2 :]]
        return chunks

    def _without_contrast(self, chunks: list[Chunk]) -> list[Chunk]:
        """Return the phrases without those said not to be meant: "to the left, not the right"."""
        robots = any("robots" in c.kinds for c in chunks)
        for k, chunk in enumerate(chunks):
            no, after = chunks[k + 1 : k + 2], chunks[k + 2 :]
            rest = [*chunks[:k], *after]
            denied = "neg" in chunk.kinds and set(chunk.kinds) <= {"neg", "clear"} and no
            ended = not after or "sep" in after[0].kinds
            if denied and ended and any(_contrasts(no[0], c) for c in rest):
                return rest[:-1] if rest and "sep" in rest[-1].kinds else rest
            named = self.words[chunk.start : chunk.end].lower().startswith("not ")
            if robots and named and "other" in chunk.kinds:  # "not that one, number six"
                return [*chunks[:k], *chunks[k + 1 :]]
        return chunks

    def _framed(self, chunks: Sequence[Chunk], before: tuple[Effect, ...]) -> Clause | None:
        """Return the clause of the first frame that takes all phrases and uses them, or None."""
        asks, only_asks = self._asks()
        edits = tuple(e for e in before if e["kind"] not in NO_EDITS)
        phrases = tuple((c, self.words[c.start : c.end]) for c in chunks)
        said = Utterance(
            self.standing, self.words_of(chunks), edits, self.denies, phrases, self.words
        )
        for frame in frames():
            if (frame.asks and not asks) or (
                only_asks and not frame.asks and frame.name not in TALK
            ):
                continue
            slots = frame.slots(chunks)
            if frame.name in ("thanks", "hello") and not all(map(_is_kind, chunks)):
                continue
            effects = None if slots is None else _frame_effects(frame, slots, said)
            changes = any(e["kind"] not in NO_EDITS for e in effects or ())
            if effects and slots is not None and not (changes and slots.unused):
                teamed = tuple(self._of_team(e, chunks, said.words) for e in effects)
                return Clause(tuple(chunks), frame.name, teamed)
        return None

    def _asks(self) -> tuple[bool, bool]:
        """Return whether the line may be a question, and whether it can be nothing else."""
        words = self.asking or self.words
        text = re.sub(OPENERS, "", words.lower().lstrip("\"' "))
        telling = next((t for t in rules()["telling"] if re.match(rf"{t}\b", text)), "")
        text = text[len(telling) :].lstrip(" ,:")
        word = next(iter(re.findall(r"^[a-z']+", text)), "")
        polite = any(re.match(rf"{p}\b", text) for p in rules()["polite"])
        leads = word in rules()["questions"] and not polite
        marked = words.rstrip().endswith("?")
        either = word in ("can", "could", "would", "will", "may")
        either = either or (not marked and word in ("have", "do", "any"))
        open_ = re.match(r"(?:can|could) (?:it|they|any|some)", text) is not None
        return leads or marked or open_, leads and not either

    def _of_team(self, effect: Effect, chunks: Sequence[Chunk], words: str) -> Effect:
        """Return the edit for the group whose thing is named, or a question if it is not clear."""
        kind, groups = effect["kind"], self.standing.groups
        if len(groups) < 2 or "group" in effect or (kind == "add" and "to" in effect):
            return effect
        named = [str(c.kinds["current"]) for c in chunks if "current" in c.kinds]
        if kind == "heading":
            named = [name for name in named if name != effect["to"]]
        found = [k for k, g in enumerate(groups, 1) if named and named[-1] in g.get("targets", ())]
        if found and kind in (*OF_TEAMS, *OF_A_TEAM):
            return effect | {"group": found[0]}
        rings = [k for k, g in enumerate(groups, 1) if g["relation"] != "at"]
        if len(rings) == 1 and kind in OF_A_TEAM and kind != "count" and "robots" not in effect:
            return effect | {"group": rings[0]}  # a robot that stands by itself is no team
        if kind == "count" or (kind in OF_A_TEAM and "robots" not in effect):
            options = [f"{words} at {t}" for t in self.standing.targets]
            return ask(f"There are {len(groups)} teams. Which one?", *options)[0]
        return effect

    def _corrected(self) -> list[Clause] | None:
        """Return what is meant after "no wait", or of the last words if this corrects or adds."""
        own = self.clauses(self.chunks) if self.denies else None
        asked, verb = self.standing.said[-1:] == "?", any("move" in c.kinds for c in self.chunks)
        if own and all(((asked and verb) or c.frame == "allotted") and c.settled for c in own):
            return own
        marks = [k for k, c in enumerate(self.chunks) if k and {"correction", "no"} & set(c.kinds)]
        if marks and marks[-1] < len(self.chunks) - 1:
            first = [c for c in self.chunks[: marks[-1]] if not {"correction", "no"} & set(c.kinds)]
            after = [c for c in self.chunks[marks[-1] + 1 :] if not is_empty(c)]
            clauses = self.clauses(first)
            if clauses is None and any("unknown" in c.kinds for c in first):
                return None
            return self._substituted(clauses or [], after) or self.clauses(after)
        too = any("too" in c.kinds for c in self.chunks) or "and" in self.led.split()
        after = [c for c in self.chunks if "too" not in c.kinds and not is_empty(c)]
        robots = bool(after) and all({"robots", "stay"} & set(c.kinds) for c in after)
        if robots and self.standing.said not in ("", self.standing.words):
            return self._of_words(self.standing.said, after)
        amounts = bool(after) and all({"px", "angle"} & set(c.kinds) for c in after)
        if (
            after
            and (amounts or self.denies)
            and self.standing.said not in ("", self.standing.words)
        ):
            return self.clauses(after) if self.adds else self._of_words(self.standing.said, after)
        if not self.standing.words or not after or not (self.denies or (too and robots)):
            return None
        if robots and not self.denies:
            return self._for_robots(after) or self._of_words(self.standing.words, after)
        return None if self.adds else self._instead(self._of_words(self.standing.words, after))

    def _of_words(self, words: str, after: Sequence[Chunk]) -> list[Clause] | None:
        """Return the clauses of earlier words with phrases of this line put in, or None."""
        line = Line(words, replace(self.standing, words="", said="", edits=()))
        clauses = line.clauses(line.chunks)
        self.asking = line.words
        found = self._substituted(clauses or [], after)
        self.asking = ""
        return found

    def _instead(self, found: list[Clause] | None) -> list[Clause] | None:
        """Return the clauses as one change that takes the last one back first, where relative."""
        kinds = {e["kind"] for c in found or () for e in c.effects}
        if not found or not self.standing.edits or not kinds & {*followup_last.RELATIVE}:
            return found
        edits = [e for c in found for e in c.effects]
        effects = followup_last.corrected([dict(e) for e in self.standing.edits], edits)
        return [replace(found[0], effects=tuple(effects), frame="corrected")]

    def _for_robots(self, after: Sequence[Chunk]) -> list[Clause] | None:
        """Return the last edit for other robots: "and robot 3 too"; None if it is for none."""
        robots = [r for c in after for r in c.kinds.get("robots", ())]
        last = dict(self.standing.edits[-1]) if len(self.standing.edits) == 1 else {"kind": ""}
        if not robots or any("stay" in c.kinds for c in after):
            return None
        before = chunks_of(spelled(self.standing.words), self.standing)
        outward = any("radial" in c.kinds for c in before)  # each in its own direction
        if last["kind"] == "place" and "to" not in last and not outward:
            return [Clause((), "again", tuple(last | {"robot": r} for r in robots))]
        if last.get("robots") and last["kind"] in ("remove", "skip", "target"):
            return [Clause((), "again", (last | {"robots": robots},))]
        return None

    def _substituted(
        self, clauses: Sequence[Clause], after: Sequence[Chunk]
    ) -> list[Clause] | None:
        """Return the clauses with phrases put in the place of others of their kind, or None."""
        for at in range(len(clauses) - 1, -1, -1):
            chunks = _with_replaced(clauses[at], after)
            clause = None if chunks is None else self._framed(chunks, ())
            if clause is not None and clause.frame == clauses[at].frame:
                return [*clauses[:at], clause, *clauses[at + 1 :]]
        return None


def _commanding(chunks: Sequence[Chunk]) -> list[Chunk]:
    """Return the phrases; "go" is no filler in a part that has nothing but fillers beside it."""
    ends = [k for k, c in enumerate(chunks) if "sep" in c.kinds]
    found = list(chunks)
    for first, last in pairwise([-1, *ends, len(chunks)]):
        told = [k for k in range(first + 1, last) if {*chunks[k].kinds} - {"filler"}]
        for k in told if all({"go", "only"} & {*chunks[k].kinds} for k in told) else ():
            kinds = {name: v for name, v in chunks[k].kinds.items() if name != "filler"}
            found[k] = replace(chunks[k], kinds=kinds) if "go" in kinds else chunks[k]
    return found


def _contrasts(a: Chunk, b: Chunk) -> bool:
    """Return whether two phrases give different values of the same kind."""
    kinds = [k for k in (*REPLACED, *AMOUNTS) if k in a.kinds and k in b.kinds]
    found = not str(a.kinds.get("thing", "")).startswith("?")
    return found and bool(kinds) and all(a.kinds[k] != b.kinds[k] for k in kinds)


def _as_team(chunk: Chunk) -> Chunk:
    """Return a phrase for the others as one for all robots that are not said to stay."""
    return replace(chunk, kinds={"team": ""})


def is_empty(chunk: Chunk) -> bool:
    """Return whether a phrase says nothing by itself."""
    return bool({"filler", "sep"} & set(chunk.kinds)) and set(chunk.kinds) <= SLIGHT


def is_part(chunk: Chunk) -> bool:
    """Return whether a phrase only names a part of a command: a robot, amount, side or thing."""
    return bool(set(chunk.kinds) & {*REPLACED, *AMOUNTS, *rules()["common"], "yes", "current"})


def _is_kind(chunk: Chunk) -> bool:
    """Return whether a phrase is no more than thanks or a greeting, or says nothing beside one."""
    return bool({"thanks", "hello"} & set(chunk.kinds)) or is_empty(chunk)


def _is_pure(chunk: Chunk) -> bool:
    return bool({"filler", "sep", "correction"} & set(chunk.kinds)) and set(chunk.kinds) <= PURE


def _with_replaced(clause: Clause, after: Sequence[Chunk]) -> list[Chunk] | None:
    """Return the phrases of a clause with others put in; None where one has no place there."""
    chunks, changed = list(clause.chunks), False
    for new in after:
        fits = [k for k in range(len(chunks) - 1, -1, -1) if _stands_for(new, chunks[k])]
        kinds = set(new.kinds)  # prefer a number over "a bit", and the same kind over another
        fits.sort(key=lambda k: ("much" in chunks[k].kinds, kinds.isdisjoint(chunks[k].kinds)))
        at = next(iter(fits), None)
        if at is not None:
            unit = next((u for u in ("px", "angle", "robots") if u in chunks[at].kinds), "")
            bare = unit if "num" in kinds else ""
            value = (int(new.kinds["num"]),) if bare == "robots" else new.kinds.get("num")
            chunks[at] = replace(new, kinds={bare: value}) if bare else new
            changed = True
        elif kinds & {*AMOUNTS} or (clause.frame == "rotate" and kinds & {"dir", "spin"}):
            chunks.append(new)
            changed = True
        elif not kinds & {*rules()["common"]}:
            return None
    return chunks if changed else None


def _stands_for(new: Chunk, old: Chunk) -> bool:
    """Return whether a phrase can replace another: both give the same kind of value."""
    amounts = bool(set(new.kinds) & {*AMOUNTS}) and bool(set(old.kinds) & {*AMOUNTS})
    amounts = amounts or ("num" in new.kinds and "robots" in old.kinds)
    return amounts or bool(set(new.kinds) & set(old.kinds) & {*REPLACED})


def _frame_effects(frame: Frame, slots: Slots, said: Utterance) -> Effects:
    """Return the effects of a frame, from the function of the frame's name."""
    if frame.name.startswith("ask_"):
        return followup_turns.asked(slots, said, frame.name.removeprefix("ask_"))
    if frame.name in TALK:
        return [{"kind": "talk", "about": frame.name}]
    modules = (
        *(followup_edits, followup_moves, followup_parts, followup_sides, followup_teams),
        *(followup_last, followup_turns),
    )
    build: Callable[[Slots, Utterance], Effects] = next(
        getattr(module, frame.name) for module in modules if hasattr(module, frame.name)
    )
    return build(slots, said)
