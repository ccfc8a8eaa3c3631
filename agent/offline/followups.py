"""What is said to a plan that stands, to edits of it, an answer, or a question.

A line is parted into clauses so that a frame of followups.yaml takes every phrase of each. Where
none does, it may be a whole new instruction; else it is asked about, quoting what was not
understood. Nothing said is left out.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from . import followup_edits, followup_teams, followup_turns
from .accounting import read_instruction
from .drafting import contract_of
from .drawn_forms import form_in
from .followup_edits import Effect, Effects, Said, ask
from .followup_frames import Frame, Slots, frames
from .followup_words import Chunk, chunks_of, rules, spelled
from .standing import Standing

Kind = str
"""edits, undo, go, hold, query, talk, ask, refuse, instruction."""
TALK = ("did", "why", "help", "status", "thanks", "hello")
WITHOUT_PLAN = (
    *TALK,
    "go",
    "hold",
    "undo",
    "redo",
    "first",
    "restart",
    "refuse_checks",
    "refuse_through",
)
RENAMED: dict[str, Callable[[Slots, Said], Effects]] = {
    "open": followup_teams.opened,
}
INSTRUCTING = ("arrange", "target", "close", "cage", "count", "split", "sides", "gap", "distance")
"""Frames of what may be said when no plan stands: an instruction."""
AMOUNTS = ("px", "angle", "share", "much", "num", "m")
SAME = (
    *AMOUNTS,
    "robots",
    "dir",
    "side",
    "flank",
    "radial",
    "thing",
    "other",
    "there",
    "spin",
    "axis",
    "portion",
    "scale",
    "apart",
    "inward",
    "point",
    "relation",
)
"""Kinds of phrases that stand for others of the same kind: "left. no wait, right"."""
ADDITIVE = ("more", "less", "again", "toofar", "otherway")
PLAIN = "What should change? For example: a bit further out, turn it 30 degrees, two more robots, or undo."
NO_PLAN = "No plan stands yet. Say what to do, such as: surround the coin with 6 robots."


@dataclass(frozen=True)
class Followup:
    """What is to be done in a turn.

    Attributes:
        kind: what it is above all.
        undo: steps to take back first; below 0 to make again.
        to: the plan to go back to instead, "first".
        edits: then, in order, as edit_formation takes them. An id that begins with "?" is words
            for a thing that has to be found; px and by may be {"factor": f}, {"more": px},
            {"out": px} or {"in": px} of what is measured.
        stay: robots that do not move meanwhile.
        go, hold: whether robots move then, or not before "go".
        query: what is asked of the plan: about, and robots or a thing.
        about: small talk: thanks, hello, help, did, why, status, already.
        text: a question or a refusal. options: commands that answer the question.
        understood: words that would do alone, where others were not understood.
        instruction: the words, where they are a whole new instruction; with `robots` of the plan.
    """

    kind: Kind
    undo: int = 0
    to: str = ""
    edits: tuple[Effect, ...] = ()
    stay: tuple[int, ...] = ()
    go: bool = False
    hold: bool = False
    query: Effect | None = None
    about: str = ""
    text: str = ""
    options: tuple[str, ...] = ()
    rest: str = ""

    @property
    def things(self) -> list[str]:
        """Words for things that have to be found, once each."""
        named = re.findall(r"'\?([^']*)'", repr([*self.edits, self.query]))
        return list(dict.fromkeys(named))


def read_followup(words: str, standing: Standing | None) -> Followup:
    """What is meant by words that are said when a plan stands, or talk that fits at any time."""
    return _Reader(words, standing).read()


@dataclass(frozen=True)
class _Clause:
    """Phrases that one frame takes, the frame, and what it comes to."""

    chunks: tuple[Chunk, ...]
    frame: str
    effects: tuple[Effect, ...]


NOTHING = Standing("", {"groups": [{"relation": "around", "targets": [], "robots": 0}]}, ())
_SEQUENCE = re.compile(
    r"^\W*first\b[ ,:]*(?P<now>.+?)[,;.]?\s+(?:and )?then\b,?\s*(?P<rest>.+)$", re.IGNORECASE
)


class _Reader:
    """Reads one line."""

    def __init__(self, words: str, standing: Standing | None) -> None:
        self.words, self.there = spelled(words), standing is not None
        self.standing = standing or NOTHING
        self.led = ""
        self.excepted: tuple[int, ...] = ()

    def read(self) -> Followup:
        """The follow-up; see the module."""
        sequence = _SEQUENCE.match(self.words) if self.there else None
        if sequence:
            now = read_followup(sequence["now"], self.standing)
            later = read_followup(sequence["rest"], self.standing)
            unclear = next(
                (f for f in (now, later) if f.kind in ("ask", "refuse", "instruction")), None
            )
            return unclear or replace(now, rest=sequence["rest"])
        chunks = [
            c
            for c in map(self._resolved, chunks_of(self.words, self.standing))
            if "quote" not in c.kinds
        ]
        impossible = self._impossible(chunks)
        if impossible:
            return Followup("refuse", text=impossible)
        chunks = self._without_lead(chunks)
        greeted = ("hello" in self.led or "thanks" in self.led) and all(
            set(c.kinds) <= SLIGHT for c in chunks
        )
        if greeted or all(map(_is_empty, chunks)):
            return self._said_nothing()
        chunks = self._without_excepted(chunks)
        clauses = self._corrected(chunks) or self._clauses(chunks, ())
        if clauses is None:
            return self._otherwise(chunks)
        if not self.there and any(c.frame not in WITHOUT_PLAN for c in clauses):
            whole = all(c.frame in INSTRUCTING for c in clauses)
            return Followup(
                "instruction" if whole else "refuse", text=self.words if whole else NO_PLAN
            )
        return self._gathered(clauses)

    def _resolved(self, chunk: Chunk) -> Chunk:
        """A thing as its id, where it is known; one that the plan is about as `current`."""
        kinds = dict(chunk.kinds)
        text = self.words[chunk.start : chunk.end].lower()
        if (self.standing.pointed or self.standing.place) and text in ("that", "this", "here"):
            kinds["there"] = ""
        if "lone" in kinds and len(self.standing.robots) == 1:
            kinds["team"] = ""
        if "thing" not in kinds:
            return replace(chunk, kinds=kinds)
        name = self._id_of(str(kinds["thing"]), bool(kinds.pop("other", False)))
        kinds["thing"] = name
        if name in self.standing.targets:
            kinds["current"] = name
            if len(self.standing.groups) < 2:
                del kinds["thing"]
        return replace(chunk, kinds=kinds)

    def _id_of(self, phrase: str, other: bool) -> str:
        if re.fullmatch(r"[tc][0-9]+", phrase):
            return phrase if phrase[0] == "t" else f"?{phrase}"
        standing = self.standing
        words = set(re.findall(r"[a-z]+", phrase)) - {"one", "the", "thing", "object"}
        known = [(t, set(re.findall(r"[a-z]+", label.lower()))) for t, label in standing.things]
        if other:
            known = [(t, label) for t, label in known if t not in standing.targets]
        named = [t for t, label in known if words and words <= label]
        side = followup_edits.SIDE_OF.get(
            {"upper": "top", "lower": "bottom", "leftmost": "left", "rightmost": "right"}.get(
                *[next(iter(words), "")] * 2
            )
        )
        centre = standing.centre or {}
        if len(words) == 1 and side and len(centre) > 1:
            x, sign = (
                (0 if side in ("left", "right") else 1),
                (-1 if side in ("left", "top") else 1),
            )
            best = max(centre, key=lambda t: sign * centre[t][x])
            return best if best not in standing.targets else f"?{phrase}"
        if len(named) == 1:
            return named[0]
        return f"?other {phrase}" if other else f"?{phrase}"

    def _impossible(self, chunks: Sequence[Chunk]) -> str:
        """Why what is named is not there, and what would do."""
        if not self.there:
            return ""
        there = [int(r) for r in self.standing.robots if r.isdecimal()]
        for chunk in chunks:
            strange = [r for r in chunk.kinds.get("robots", ()) if r not in there]
            if strange:
                return f"There is no robot {strange[0]}: {_those(there)}. Name one of those."
            if "m" in chunk.kinds:
                return f'"{chunk.kinds["m"]}" cannot be measured: the picture has no scale. Say it in px, or give the scale with --metres-per-pixel.'
            name = str(chunk.kinds.get("thing", ""))
            known = {t for t, _ in self.standing.things} | {
                *self.standing.pointed,
                *self.standing.targets,
            }
            if name.startswith("t") and name not in known:
                return f"There is no {name}: known are {followup_edits.listed(sorted(known))}. Point at it, or name it in words."
        return ""

    def _without_lead(self, chunks: Sequence[Chunk]) -> list[Chunk]:
        """The phrases after "no", "ok", "and" and the like, which `led` keeps."""
        for k, chunk in enumerate(chunks):
            marks = [m for m in ("no", "correction", "yes", "sep") if m in chunk.kinds]
            lone = set(chunk.kinds) <= {
                "no",
                "neg",
                "correction",
                "yes",
                "filler",
                "sep",
                "thanks",
                "hello",
                "instead",
                "certq",
            }
            if (
                not (lone and (marks or "filler" in chunk.kinds))
                or self.words[chunk.start : chunk.end] == "also"
            ):
                return list(chunks[k:])
            self.led += "".join(
                f"{m} " for m in ("no", "correction", "yes", "thanks", "hello") if m in chunk.kinds
            )
            self.led += f"{self.words[chunk.start : chunk.end].lower()} "
        return []

    def _without_excepted(self, chunks: list[Chunk]) -> list[Chunk]:
        """The phrases but for "except robot 3", which `excepted` keeps."""
        at = next(
            (
                k
                for k, c in enumerate(chunks[:-1])
                if "except" in c.kinds and "robots" in chunks[k + 1].kinds
            ),
            None,
        )
        if at is None:
            return chunks
        self.excepted = tuple(chunks[at + 1].kinds["robots"])
        return [*chunks[:at], *chunks[at + 2 :]]

    def _said_nothing(self) -> Followup:
        """Talk, or yes and no to nothing that was asked."""
        if "no " in self.led or "correction" in self.led:
            return _asked(
                "What should be different? Nothing was asked.",
                ("undo", "a bit further out", "a bit closer"),
                bool(self.standing.edits),
            )
        if "thanks" in self.led and "ok " not in self.led:
            return Followup("talk", about="thanks")
        if "hello" in self.led:
            return Followup("talk", about="hello")
        if "yes" in self.led:
            return Followup(
                "refuse",
                text="Nothing was asked. To let the robots move say go; else say what should change.",
            )
        return (
            Followup("ask", text=PLAIN) if self.there else Followup("instruction", text=self.words)
        )

    def _clauses(self, chunks: Sequence[Chunk], before: tuple[Effect, ...]) -> list[_Clause] | None:
        """The fewest clauses that frames take whole; None where phrases are left over."""
        chunks = [*chunks]
        while chunks and set(chunks[0].kinds) <= PURE and set(chunks[0].kinds) & {"filler", "sep"}:
            chunks = chunks[1:]
        if all(map(_is_empty, chunks)):
            return []
        ends = [k for k, c in enumerate(chunks) if "sep" in c.kinds] + [len(chunks)]
        for end in reversed(ends):
            clause = self._framed(chunks[:end], before) if end else None
            if clause is None:
                continue
            rest = self._clauses(chunks[end:], (*before, *clause.effects))
            if rest is not None:
                return [clause, *rest]
        return None

    def _framed(self, chunks: Sequence[Chunk], before: tuple[Effect, ...]) -> _Clause | None:
        """The clause, where a frame takes it whole."""
        asks, asks_alone = self._is_question(chunks)
        words = self._words_of(chunks)
        said = Said(
            self.standing,
            words,
            tuple(e for e in before if e["kind"] not in ("stay", "rest", "hold", "go")),
        )
        for frame in frames():
            if (frame.asks and not asks) or (
                asks_alone and not frame.asks and frame.name not in TALK
            ):
                continue
            slots = frame.slots(chunks)
            effects = None if slots is None else _built(frame, slots, said)
            if (
                effects
                and slots is not None
                and not (slots.unused and any(e["kind"] not in NO_EDITS for e in effects))
            ):
                group = self._group_of(chunks)
                return _Clause(
                    tuple(chunks),
                    frame.name,
                    tuple(self._grouped(e, group, words) for e in effects),
                )
        return None

    def _is_question(self, chunks: Sequence[Chunk]) -> tuple[bool, bool]:
        """Whether a clause may ask, and whether it can do nothing else."""
        text = self.words.lower().lstrip("\"' ")
        text = re.sub(
            r"^(?:(?:so|and|ok|okay|hm+|but|now|well|please|hey|hi|no|yes|then)\b[ ,.]*)+", "", text
        )
        polite = any(re.match(rf"{p}\b", text) for p in rules()["polite"])
        asked_to = re.match(r"(?:can|could|would|will|may)\b", text) is not None
        starts = re.match(r"[a-z']+", text)
        leads = starts is not None and starts[0] in rules()["questions"] and not polite
        marked = self.words.rstrip().endswith("?")
        alone = (
            leads
            and not asked_to
            and (marked or starts[0] not in ("have", "do", "is", "are", "any"))
        )
        return leads or marked, bool(alone)

    def _group_of(self, chunks: Sequence[Chunk]) -> int | None:
        """Which group is meant, where there are several and its target is named."""
        groups = self.standing.groups
        named = [str(c.kinds["current"]) for c in chunks if "current" in c.kinds]
        found = [k for k, g in enumerate(groups, 1) if named and named[-1] in g.get("targets", ())]
        return found[0] if len(groups) > 1 and found else None

    def _grouped(self, effect: Effect, group: int | None, words: str) -> Effect:
        """The edit for one group; which one is asked where it has to be said."""
        kind = effect["kind"]
        if group is not None and kind in (*GROUPED, *ONE_GROUP):
            return effect | {"group": group}
        several = len(self.standing.groups) > 1 and (kind in ONE_GROUP) and "robots" not in effect
        if several or (kind == "count" and len(self.standing.groups) > 1):
            options = [f"{words} at {t}" for t in self.standing.targets]
            return ask(f"There are {len(self.standing.groups)} teams. Which one?", *options)[0]
        return effect

    def _corrected(self, chunks: Sequence[Chunk]) -> list[_Clause] | None:
        """What is meant after "no wait": it stands for what it corrects."""
        marks = [
            k
            for k, c in enumerate(chunks)
            if "correction" in c.kinds or (k and set(c.kinds) & {"no"})
        ]
        if marks and marks[-1] < len(chunks) - 1:
            first = [c for c in chunks[: marks[-1]] if not set(c.kinds) & {"correction", "no"}]
            after = self._stripped(chunks[marks[-1] + 1 :])
            if not after:
                return None
            clauses = self._clauses(first, ()) if first else []
            if clauses is None:
                return (
                    self._clauses(after, ())
                    if not any("unknown" in c.kinds for c in first)
                    else None
                )
            return self._substituted(clauses, after) or self._clauses(after, ())
        too = any("too" in c.kinds for c in chunks) or self.words.lower().strip().startswith("and ")
        led = "no " in self.led or "correction" in self.led
        if not self.standing.words or not (led or too):
            return None
        old = _Reader(self.standing.words, replace(self.standing, words="", edits=()))
        before = old._clauses(
            old._without_lead([old._resolved(c) for c in chunks_of(old.words, self.standing)]), ()
        )
        after = self._stripped([c for c in chunks if "too" not in c.kinds])
        alone = all(set(c.kinds) & {"robots", "filler", "sep", "stay"} for c in after)
        if not before or not after or (too and not led and not alone):
            return None
        clauses = self._substituted(before, after)
        if clauses and led and self._is_relative(clauses) and self.standing.edits:
            undone = _Clause((), "undo", ({"kind": "undo", "steps": 1},))
            return [undone, *clauses]
        return clauses

    def _is_relative(self, clauses: Sequence[_Clause]) -> bool:
        return any(e["kind"] in followup_turns.RELATIVE for c in clauses for e in c.effects)

    def _stripped(self, chunks: Sequence[Chunk]) -> list[Chunk]:
        return [c for c in chunks if not _is_empty(c)]

    def _substituted(
        self, clauses: Sequence[_Clause], after: Sequence[Chunk]
    ) -> list[_Clause] | None:
        """The clauses with phrases in the place of others of their kind, the last that fits."""
        for at in range(len(clauses) - 1, -1, -1):
            chunks = list(clauses[at].chunks)
            for new in after:
                same = [k for k, c in enumerate(chunks) if _stands_for(new, c)]
                if same:
                    chunks[same[-1]] = new
                elif set(new.kinds) & {*AMOUNTS} or self._steers(clauses[at], new):
                    chunks.append(new)
                else:
                    break
            else:
                clause = self._framed(chunks, ())
                if clause is not None and clause.frame == clauses[at].frame:
                    return [*clauses[:at], clause, *clauses[at + 1 :]]
        return None

    def _steers(self, clause: _Clause, new: Chunk) -> bool:
        return clause.frame == "rotate" and bool({"dir", "spin"} & set(new.kinds))

    def _gathered(self, clauses: Sequence[_Clause]) -> Followup:
        """All that the clauses come to."""
        effects = [e for c in clauses for e in c.effects]
        for kind in ("ask", "refuse"):
            found = next((e for e in effects if e["kind"] == kind), None)
            if found is not None:
                return Followup(
                    kind,
                    text=found.get("question") or found["text"],
                    options=tuple(found.get("options", ())),
                )
        undo = sum(e.get("steps", 0) for e in effects if e["kind"] == "undo")
        same = [
            c for c in clauses if c.frame == "again" and "same" in self._words_of(c.chunks).lower()
        ]
        if same and len(clauses) > len(same):
            effects = [e for c in clauses if c not in same for e in c.effects]
        edits = [e for e in effects if e["kind"] not in NO_EDITS]
        contrary = {e["kind"] for e in edits} >= {"out", "in"} and not any(
            "group" in e for e in edits
        )
        if sum(e["kind"] == "target" and "robots" not in e for e in edits) > 1:
            return Followup("ask", text=f'"{self.words}" names several things. Around which one?')
        if contrary:
            return Followup(
                "ask",
                text=f'"{self.words}" says both further out and closer. Which?',
                options=("further out", "closer"),
            )
        if "no " in self.led and edits and not undo and clauses[0].frame not in ADDITIVE:
            last = self.standing.edits[0]["kind"] if self.standing.edits else ""
            alike = {edits[0]["kind"], last} <= {"out", "in"} or edits[0]["kind"] == last
            undo = int(alike and last in followup_turns.RELATIVE)
        stays = [r for e in effects if e["kind"] == "stay" for r in e["robots"]] + [*self.excepted]
        return self._settled(effects, edits, undo, stays)

    def _settled(
        self, effects: Sequence[Effect], edits: list[Effect], undo: int, stays: list[int]
    ) -> Followup:
        """The follow-up of effects that neither ask nor refuse."""
        kinds = [e["kind"] for e in effects]
        if stays and not edits:
            if not self.standing.edits:
                return Followup(
                    "ask",
                    text=f"Robot {followup_edits.listed(stays)} stays. What should the others do?",
                    options=("undo",) if self.standing.edits else (),
                )
            undo, edits = 1, [dict(e) for e in self.standing.edits]
        if "rest" in kinds:
            if not edits or any(
                e["kind"] in ("out", "in", "rotate", "shift", "scale", "spacing") for e in edits
            ):
                return Followup(
                    "ask",
                    text=f'"{self.words}": which robots are to move, and which stay? Name them by number.',
                )
            edits = [
                e | {"stay": True} if e["kind"] == "target" and "robots" in e else e for e in edits
            ]
        query = next((e for e in effects if e["kind"] == "query"), None)
        about = next((e["about"] for e in effects if e["kind"] == "talk"), "")
        to = next((e["to"] for e in effects if e["kind"] == "undo" and "to" in e), "")
        kind = (
            "edits"
            if edits
            else "undo"
            if undo or to
            else next((k for k in ("go", "hold", "query", "talk") if k in kinds), "talk")
        )
        return Followup(
            kind,
            undo,
            to,
            tuple(edits),
            tuple(stays),
            "go" in kinds,
            "hold" in kinds,
            query and {k: v for k, v in query.items() if k != "kind"},
            about,
        )

    def _otherwise(self, chunks: Sequence[Chunk]) -> Followup:
        """A whole new instruction, an arrangement that the instruction reader knows, or a question."""
        if not self.there:
            return Followup("instruction", text=self.words)
        named = any("relation" in c.kinds for c in chunks)
        text = re.sub(
            r"^\W*(?:(?:no|now|ok|okay|and|then|hm+|rather|actually|please)\b[ ,.]*)+|[ ,]+(?:instead|rather|now|please)(?=[.!?]*$)",
            "",
            self.words,
            flags=re.IGNORECASE,
        )
        reading = read_instruction(text, self.standing.metres_per_pixel)
        clear = not (
            reading.stops
            or reading.unread
            or reading.language
            or reading.unscaled
            or reading.background
        )
        settled = (
            clear
            and not any("neg" in c.kinds for c in chunks)
            and reading.sure
            and reading.relation not in ("ask", "several")
            and named
        )
        things = any("thing" in c.kinds for c in chunks)
        if settled and (reading.robots or things) and (things or reading.things):
            return Followup("instruction", text=text)
        first, last = form_in(text)[1]
        drawn = text[first:last].lower()
        known = {*rules()["common"], *rules()["void"], "relation", "thing"}
        strange = [
            c for c in chunks if not (set(c.kinds) & known or self._words_of([c]).lower() in drawn)
        ]
        if settled and reading.form is not None and not strange and not things:
            group = contract_of(reading, reading.robots or len(self.standing.robots), [], [])[
                "groups"
            ][0]
            counted: list[Effect] = (
                [{"kind": "count", "robots": reading.robots}] if reading.robots else []
            )
            fields = {
                k: v
                for k, v in group.items()
                if k not in ("robots", "targets") and (k, v) not in DEFAULTS
            }
            return Followup("edits", edits=({"kind": "arrange", "demands": fields}, *counted))
        return self._not_understood(chunks)

    def _not_understood(self, chunks: Sequence[Chunk]) -> Followup:
        """A question that says what is clear, and quotes what is not."""
        parts = list(_parts(chunks))
        clear = [
            p
            for p in parts
            if (found := self._clauses(p, ()))
            and not any(e["kind"] in ("ask", "refuse") for c in found for e in c.effects)
        ]
        unclear = [p for p in parts if p not in clear]
        unknown = [c for p in unclear for c in p if "unknown" in c.kinds or "never" in c.kinds]
        quotes = (
            [self._words_of([c]) for c in unknown]
            or [self._words_of(p) for p in unclear]
            or [self.words]
        )
        quoted = " and ".join(f'"{q}"' for q in dict.fromkeys(quotes))
        if not clear and unknown and not any("never" in c.kinds for c in unknown):
            known = [c for c in chunks if c not in unknown]
            found = self._clauses(known, ()) if known else None
            clear = (
                [known]
                if found
                and not any(e["kind"] in ("ask", "refuse") for c in found for e in c.effects)
                else []
            )
        if not clear:
            return _asked(
                f"I do not know what to do with {quoted}. {PLAIN}",
                ("undo", "a bit further out", "turn it 30 degrees"),
                bool(self.standing.edits),
            )
        understood = ", ".join(self._joined(p) for p in clear)
        return Followup(
            "ask",
            text=f'"{understood}" is clear; I do not know what to do with {quoted}. Say it another way, or leave it out.',
            options=(understood,),
        )

    def _words_of(self, chunks: Sequence[Chunk]) -> str:
        return (
            " ".join(self.words[chunks[0].start : chunks[-1].end].split()).strip(" ,.;!?")
            if chunks
            else ""
        )

    def _joined(self, chunks: Sequence[Chunk]) -> str:
        return " ".join(
            self.words[c.start : c.end]
            for c in chunks
            if self.words[c.start : c.end] not in ",.;!?"
        ).strip()


GROUPED = (
    "out",
    "in",
    "rotate",
    "mirror",
    "shift",
    "scale",
    "distance",
    "spacing",
    "heading",
    "close",
    "open",
    "escape-proof",
)
ONE_GROUP = ("add", "remove", "side", "sides", "opening", "count", "arrange")
NO_EDITS = ("ask", "refuse", "undo", "go", "hold", "query", "talk", "stay", "rest")
PURE = frozenset(("filler", "sep", "yes", "thanks", "hello", "correction"))
SLIGHT = frozenset(
    (
        "filler",
        "sep",
        "yes",
        "thanks",
        "hello",
        "move",
        "make",
        "it",
        "team",
        "leavegap",
        "about",
        "towards",
        "correction",
        "side_of",
        "instead",
        "robotword",
    )
)
DEFAULTS = (("spacing", "even"), ("fit", "normal"))


def _built(frame: Frame, slots: Slots, said: Said) -> Effects:
    """What a frame comes to: of the function of its name."""
    if frame.name.startswith("ask_"):
        return followup_turns.asked(slots, said, frame.name.removeprefix("ask_"))
    if frame.name in TALK:
        return [{"kind": "talk", "about": frame.name}]
    for module in (followup_edits, followup_teams, followup_turns):
        if frame.name not in RENAMED and hasattr(module, frame.name):
            return getattr(module, frame.name)(slots, said)
    return RENAMED[frame.name](slots, said)


def _is_empty(chunk: Chunk) -> bool:
    """Whether a phrase says nothing by itself."""
    return bool({"filler", "sep"} & set(chunk.kinds)) and set(chunk.kinds) <= SLIGHT


def _stands_for(new: Chunk, old: Chunk) -> bool:
    """Whether a phrase can be put in the place of another: both say the same kind of thing."""
    amounts = bool(set(new.kinds) & {*AMOUNTS}) and bool(set(old.kinds) & {*AMOUNTS})
    return amounts or bool(set(new.kinds) & set(old.kinds) & {*SAME})


def _parts(chunks: Sequence[Chunk]) -> list[list[Chunk]]:
    """The phrases between separators."""
    found: list[list[Chunk]] = [[]]
    for chunk in chunks:
        if "sep" in chunk.kinds:
            found.append([])
        else:
            found[-1].append(chunk)
    return [p for p in found if any(not _is_empty(c) for c in p)]


def _asked(question: str, options: tuple[str, ...], changed: bool) -> Followup:
    """A question with its options; undo is one only where something was changed."""
    return Followup(
        "ask", text=question, options=tuple(o for o in options if changed or o != "undo")
    )


def _those(there: Sequence[int]) -> str:
    return (
        f"there are robots {there[0]} to {there[-1]}"
        if len(there) > 1 and there[-1] - there[0] + 1 == len(there)
        else f"there are {followup_edits.listed(there)}"
    )
