"""Reader of words about an existing plan into edits of it, an answer, or a question.

Where no frame of followups.yaml takes every phrase, it may be a whole new instruction; else the
person is asked, quoting what was not understood. No words are left out.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from .accounting import read_instruction
from .asides import TELLS_OF, without_asides
from .clauses import NO_EDITS, SLIGHT, TALK, Clause, Line, is_empty, is_part
from .drafting import contract_of
from .drawn_forms import form_in
from .escorting import without_follow
from .followup import Followup, Kind, main_topic, robot_fields
from .followup_chunks import Chunk
from .followup_edits import Effect, listed
from .followup_go import with_sure_go
from .followup_last import RELATIVE, corrected
from .followup_places import meant_by_place, numbered
from .followup_recent import all_or_those, with_numbers
from .followup_things import impossible
from .followup_words import rules, word_set
from .spelling import spelled
from .standing import Standing
from .subjects import unclear_subject

WITHOUT_PLAN = (
    *(*TALK, "go", "hold", "undo", "redo", "first", "restart"),
    *("refuse_checks", "refuse_through"),
)
"""Frames that fit when there is no plan."""
INSTRUCTING = (
    *("arrange", "arranged", "target", "close", "cage", "count", "split", "sides", "gap"),
    *("distance", "shift"),
)
"""Frames whose words are an instruction when there is no plan."""
REMEDIES = ("out", "in", "distance", "scale", "spacing", "count", "add", "remove")
"""Kinds of edits that can be the remedy for "too close"."""
KEEPS = re.compile(
    r"\bkeep\w* (?:(?:the|this|that|their|same) )*(?P<what>distance|number)\b", re.IGNORECASE
)
KEPT = {"distance": {"out", "in", "distance", "scale"}, "number": {"count", "add", "remove"}}
"""What is to be kept, and the kinds of edits that would change it."""
ASKING = ("how", "what", "where", "who", "why")
"""Question words, with which no answer begins."""
ADDING = ("more", "less", "again", "toofar", "otherway", "corrected")
"""Frames that build on the last change even after "no"."""
PLAIN = (
    "What should change? For example: a bit further out, turn it 30 degrees, two more robots, or "
    "undo."
)
NO_PLAN = "No plan stands yet. Say what to do, such as: surround the coin with 6 robots."
NOTHING = Standing("", {"groups": [{"relation": "around", "targets": [], "robots": 0}]}, ())
SEQUENCE = re.compile(
    r"^\W*(?:please )?"
    r"(?:(?:first(?:ly| of all)?|to (?:start|begin) with|step (?:1|one)|1[.)])\b[ ,:]*(?P<now>.+?)"
    r"[,;.]?\s+(?:(?:and )?(?:then|after that|afterwards|next|second(?:ly)?)|step (?:2|two)|2[.)])"
    r"|(?:start (?:with|by) )?(?P<lead>.+?)(?: first\b[,;.]?(?: and)? then|"
    r"[,;.]? (?:and |then )?(?:after that|afterwards|(?:once|when) that'?s done|only then)))"
    r"(?<=[a-z0-9.)])\b[ ,:.]*(?P<rest>.+)$",
    re.IGNORECASE,
)
"""Two steps: one to take now, the other once it is confirmed."""
ASIDE = re.compile(
    r"^\W*(?:(?:no|now|ok|okay|and|then|hm+|rather|actually|please)\b[ ,.]*)+"
    r"|[ ,]+(?:instead|rather|now|please)(?=[.!?]*$)",
    re.IGNORECASE,
)
DEFAULTS = (("spacing", "even"), ("fit", "normal"))


def read_followup(words: str, standing: Standing | None) -> Followup:
    """Return what is meant by words about a plan; without a plan, talk or an instruction."""
    if standing is None:
        return _read_numbered(words, standing)
    words = with_numbers(words, standing)
    if not standing.places:
        read = partial(_read_numbered, standing=standing)
        return all_or_those(words, read(words), standing, read)
    told = numbered(standing)
    robots = meant_by_place(words, told, lambda text: _is_settled(_read_numbered(text, told)))
    if robots.tied:
        return Followup("ask", text=robots.question, options=robots.options, about="tied")
    meant = _read_numbered(robots.words, told)
    moved = meant.rest or (len(meant.edits) > 1 and any("robot" not in e for e in meant.edits))
    if moved and words != robots.words:
        text = f'Which robot is meant in "{words}" may change on the way. Say it in two turns.'
        return Followup("ask", text=text, about="tied")
    return all_or_those(words, meant, standing, partial(_read_numbered, standing=told))


def _is_settled(followup: Followup) -> bool:
    """Return whether it is understood, and names nothing that has to be found."""
    return followup.kind not in ("ask", "refuse", "instruction") and not followup.things


def _read_numbered(words: str, standing: Standing | None) -> Followup:
    """Return what is meant by words in which robots have their numbers."""
    if standing is not None:
        words, _ = without_follow(words, standing.stood_about, standing.metres_per_pixel)
    meant = with_sure_go(words, _read(words, standing))
    if standing is None or not (meant.kind == "ask" or meant.things):
        return meant
    kept, told = without_asides(words, standing)
    told = told if meant.kind == "ask" else tuple(part for part in told if TELLS_OF.match(part))
    if not told or not kept.strip(" ,.;:!?"):
        return meant
    plain = with_sure_go(words, _read(kept, standing))
    clear = plain.kind not in ("ask", "instruction", "talk")
    return replace(plain, background=(*plain.background, *told)) if clear else meant


def _read(words: str, standing: Standing | None) -> Followup:
    """Return what is meant by all of the words, asides included."""
    sequence = SEQUENCE.match(spelled(words)) if standing else None
    if sequence:
        now = read_followup(sequence["now"] or sequence["lead"], standing)
        later = read_followup(sequence["rest"], standing)
        unclear = (f for f in (now, later) if f.kind in ("ask", "refuse", "instruction"))
        done = now.kind == "talk" and now.about == "already"
        return next(unclear, later if done else replace(now, rest=sequence["rest"]))
    line = Line(words, standing or NOTHING)
    refused = impossible(line.chunks, standing) if standing else ""
    if refused:
        return Followup("refuse", text=refused)
    greets = "hello" in line.led or "thanks" in line.led
    if all(is_empty(c) or (greets and set(c.kinds) <= SLIGHT) for c in line.chunks):
        return _without_content(line, there=standing is not None)
    afresh = _new_instruction(line)
    if afresh:
        return Followup("instruction", text=afresh)
    clauses = line.read()
    if standing is None:
        return _without_plan(line, clauses)
    return _not_framed(line) if clauses is None else _combined_followup(line, clauses)


def commands(words: str, standing: Standing) -> bool:
    """Return whether words are a command or question of their own, not just an answer."""
    lead = next(iter(re.findall(r"[a-z']+", words.lower())), "")
    if lead in ASKING or (lead in word_set("questions") and words.rstrip().endswith("?")):
        return True
    line, read = Line(words, standing), read_followup(words, standing)
    verbs = (c for c in line.chunks if {"make", "move"} & set(c.kinds) or not is_part(c))
    understood = read.kind not in ("ask", "refuse", "instruction") or read.about == "tied"
    return any(verbs) and understood


def _new_instruction(line: Line) -> str:
    """Return the instruction after "start over", "" if there is none."""
    if not line.chunks or "restart" not in line.chunks[0].kinds:
        return ""
    left = [c for c in line.chunks[1:] if not is_empty(c)]
    return line.words[left[0].start :] if len(left) > 1 else ""


def _without_content(line: Line, *, there: bool) -> Followup:
    """Return the follow-up of words without content: talk, or a yes or no to no question."""
    if line.denies:
        options = ("undo", "a bit further out", "a bit closer")
        return _as_question(line, "What should be different? Nothing was asked.", options)
    if "thanks" in line.led and "ok " not in line.led:
        return Followup("talk", about="thanks")
    if "hello" in line.led:
        return Followup("talk", about="hello")
    if "yes" in line.led:
        advice = "To let the robots move say go; else say what should change."
        return Followup("refuse", text=f"Nothing was asked. {advice}")
    return Followup("ask", text=PLAIN) if there else Followup("instruction", text=line.words)


def _without_plan(line: Line, clauses: Sequence[Clause] | None) -> Followup:
    """Return the follow-up of words when there is no plan."""
    if clauses is None or all(c.frame in INSTRUCTING for c in clauses):
        return Followup("instruction", text=line.words)
    if all(c.frame in WITHOUT_PLAN for c in clauses):
        return _combined_followup(line, clauses)
    return Followup("refuse", text=NO_PLAN)


def _as_question(line: Line, question: str, options: tuple[str, ...] = ()) -> Followup:
    """Return a question with its options; undo is one only where something was changed."""
    offered = tuple(o for o in options if line.standing.edits or o != "undo")
    return Followup("ask", text=question, options=offered)


def _combined_followup(line: Line, clauses: Sequence[Clause]) -> Followup:
    """Return the follow-up that all clauses together amount to."""
    same = [c for c in clauses if c.frame == "again" and "same" in line.words_of(c.chunks).lower()]
    kept = [c for c in clauses if c not in same] or clauses  # "same again, closer"
    kept = _without_moot(line, kept)
    complaints = [c for c in kept if c.frame == "toofar"]
    remedies = [c for c in kept if c not in complaints and _edits(c)]
    if complaints and remedies:  # the remedy says what to do about the complaint
        plain = _combined_followup(line, [c for c in kept if c not in complaints])
        told = (*plain.background, *(line.words_of(c.chunks) for c in complaints))
        return replace(plain, background=told)
    effects = [e for c in kept for e in c.effects]
    unsettled = next((e for e in effects if e["kind"] in ("ask", "refuse")), None)
    if unsettled is not None and unsettled["kind"] == "ask":
        return Followup("ask", text=unsettled["question"], options=unsettled["options"])
    if unsettled is not None:
        return Followup("refuse", text=unsettled["text"])
    edits = _without_cancelling([e for e in effects if e["kind"] not in NO_EDITS])
    fresh = all(c.frame != "corrected" for c in kept)
    question = _contradiction(line, edits) if fresh else None
    if question is not None:
        return question
    undo = sum(e.get("steps", 0) for e in effects if e["kind"] == "undo")
    # first keep the old spacing; last close the ring, with the final number of robots
    edits.sort(key=lambda e: (e.get("factor") != 1, e["kind"] == "escape-proof"))
    added = line.adds or clauses[0].frame in ADDING
    if "no " in line.led and edits and not undo and not added:
        last = [dict(e) for e in line.standing.edits]
        kind = last[0]["kind"] if len(last) == 1 else ""
        alike = edits[0]["kind"] == kind or {edits[0]["kind"], kind} <= {"out", "in"}
        if alike and kind in RELATIVE:
            made = corrected(last, edits)
            undo = sum(e.get("steps", 0) for e in made if e["kind"] == "undo")
            edits = [e for e in made if e["kind"] != "undo"]
    moot = [line.words_of(c.chunks) for c in clauses if c.frame == "toofar" and c not in kept]
    return replace(_settled(line, effects, edits, undo), background=tuple(moot))


def _edits(clause: Clause) -> bool:
    """Return whether a clause changes something."""
    return any(e["kind"] not in (*NO_EDITS, "ask", "refuse", "undo") for e in clause.effects)


def _without_cancelling(edits: list[Effect]) -> list[Effect]:
    """Return the edits without repeats that would cancel out: "flip it, mirror it"."""
    twice = [k for k in range(1, len(edits)) if edits[k] == edits[k - 1]]
    return [e for k, e in enumerate(edits) if k not in twice or e["kind"] not in ("mirror", "swap")]


def _without_moot(line: Line, clauses: Sequence[Clause]) -> Sequence[Clause]:
    """Return the clauses that no others make moot: "too much, go back", "never mind, closer"."""
    undone = any(c.frame in ("undo", "first") for c in clauses)
    kept = [c for c in clauses if not (undone and c.frame in ADDING)]
    waving = {"mind", "forget"}
    waved = [c for c in kept if waving & set(line.words_of(c.chunks).lower().split())]
    lessened = [c for c in kept if c.frame in ("less", "toofar")]
    gaps = any(e["kind"] == "opening" for c in kept if c not in lessened for e in c.effects)
    others = [e["kind"] for c in kept if c not in lessened for e in c.effects]
    other = any(c not in lessened and c.frame not in TALK for c in kept)
    mended = gaps or any(kind in REMEDIES for kind in others)
    doubtful = [c for c in lessened if mended or (other and not c.settled)]
    moot = [*waved, *lessened[1:], *doubtful]
    return [c for c in kept if c not in moot] or kept


def _contradiction(line: Line, edits: Sequence[Effect]) -> Followup | None:
    """Return the question to ask where edits contradict each other, else None."""
    alone = [
        e["kind"]
        for e in edits
        if "group" not in e and (e["kind"] == "count" or not e.get("robots"))
    ]
    who = unclear_subject(line.words, edits, pointed=bool(line.standing.pointed))
    if who:
        return _as_question(line, who)
    kept = KEEPS.search(line.words)
    if kept and {*alone} & KEPT[kept["what"].lower()]:
        question = f'"{line.words}" both changes and keeps the {kept["what"]}. Which?'
        return _as_question(line, question)
    if {"out", "in"} <= {*alone}:
        says = "says both further out and closer. Which?"
        return _as_question(line, f'"{line.words}" {says}', ("further out", "closer"))
    stated = [k for k in ("distance", "count", "sides", "side") if alone.count(k) > 1]
    if stated:
        return _as_question(line, f'"{line.words}" says two things of the {stated[0]}. Which one?')
    parted = [
        e["to"] for e in edits if e["kind"] == "target" and e.get("robots") and "group" not in e
    ]
    if len(set(parted)) < len(parted):
        return _as_question(line, f'"{line.words}": which robots are to go, and where? Name them.')
    if alone.count("target") > 1:
        return _as_question(line, f'"{line.words}" names several things. Around which one?')
    return None


def _settled(line: Line, effects: Sequence[Effect], edits: list[Effect], undo: int) -> Followup:
    """Return the follow-up of effects that neither ask nor refuse."""
    kinds = [e["kind"] for e in effects]
    stays = [r for e in effects if e["kind"] == "stay" for r in e["robots"]] + [*line.excepted]
    moved = {e.get(name) for e in line.standing.edits for name in robot_fields(e)}
    swapped = [e["kind"] for e in line.standing.edits] == ["swap"] and moved & {*stays}
    unchanged = not moved or line.standing.said not in ("", line.standing.words)
    if stays and not edits and unchanged and line.denies:
        return Followup("talk", about="already")
    if stays and not edits and (swapped or (moved and moved <= {*stays})):
        return Followup("undo", undo=1)
    if stays and not edits:
        if not line.standing.edits:
            return _as_question(line, f"Robot {listed(stays)} stays. What should the others do?")
        undo, edits = 1, [dict(e) for e in line.standing.edits]
    if "rest" in kinds:
        moved = ("out", "in", "rotate", "shift", "scale", "spacing")
        if not edits or any(e["kind"] in moved for e in edits):
            which = "which robots are to move, and which stay? Name them by number."
            return _as_question(line, f'"{line.words}": {which}')
        edits = [e | {"stay": True} if e["kind"] == "target" else e for e in edits]
    queries = _without_cancelling([e for e in effects if e["kind"] == "query"])
    if len(queries) > 1 or (queries and edits):
        return _as_question(line, f'"{line.words}" says more than one thing. Which comes first?')
    query = next(iter(queries), None)
    to = next((e["to"] for e in effects if e["kind"] == "undo" and "to" in e), "")
    others: tuple[Kind, ...] = ("go", "hold", "query")
    rest: tuple[Kind, ...] = tuple(k for k in others if k in kinds) or ("talk",)
    return Followup(
        "edits" if edits else "undo" if undo or to else rest[0],
        undo=undo,
        to=to,
        edits=tuple(edits),
        stay=tuple(stays),
        go="go" in kinds and not edits,  # the person looks at a new plan first
        hold="hold" in kinds,
        query=query and {k: v for k, v in query.items() if k != "kind"},
        about=main_topic([e["about"] for e in effects if e["kind"] == "talk"]),
    )


def _not_framed(line: Line) -> Followup:
    """Return a whole new instruction, a form that the instruction reader knows, or a question."""
    text = ASIDE.sub("", line.words)
    reading = read_instruction(text, line.standing.metres_per_pixel)
    left = (reading.stops, reading.unread, reading.language, reading.unscaled, reading.background)
    kinds = {kind for c in line.chunks for kind in c.kinds}
    settled = not any(left) and reading.sure and reading.relation not in ("ask", "several")
    counted = re.search(r"\b(?:robots?|bots?|drones?|rovers?)\b", text, re.IGNORECASE)
    beside = reading.relation == "along" and reading.robots is not None and counted
    if not settled or not ("relation" in kinds or beside) or "neg" in kinds:
        return _not_understood(line)
    shown = "there" in kinds and bool(line.standing.pointed)
    if "thing" in kinds or beside or (reading.robots and (reading.things or shown)):
        return Followup("instruction", text=text)
    drawn = text[slice(*form_in(text)[1])].lower()
    known = {*rules()["common"], *rules()["void"], "relation"}
    known |= {"side", "dir"} if "side" in reading.group else set[str]()
    words = (line.words_of([c]).lower() for c in line.chunks if not known & set(c.kinds))
    if reading.form is None or any(word not in drawn for word in words):
        return _not_understood(line)
    group = contract_of(reading, reading.robots or len(line.standing.robots), [], [])["groups"][0]
    fields = {k: v for k, v in group.items() if (k, v) not in DEFAULTS}
    demands = {k: v for k, v in fields.items() if k not in ("robots", "targets")}
    shape = demands["shape"]
    shape["where"] = shape["where"] or line.standing.place_of(shape["kind"])
    if shape["where"] is None:
        options = tuple(f"{text} on the {side}" for side in ("left", "right"))
        return _as_question(line, f'Where by it, in "{text}"?', options)
    edits: list[Effect] = [{"kind": "arrange", "demands": demands}]
    edits += [{"kind": "count", "robots": reading.robots}] if reading.robots else []
    return Followup("edits", edits=tuple(edits))


def _not_understood(line: Line) -> Followup:
    """Return a question that says what is clear, and quotes what is not."""
    parts = _parts(line.chunks)
    read = [p for p in parts if _is_clear(line, p)]
    unclear = [p for p in parts if p not in read]
    clear = [p for p in read if any(c.frame not in TALK for c in line.clauses(p) or ())]
    unknown = [c for p in unclear for c in p if {"unknown", "never"} & set(c.kinds)]
    quotes = [line.words_of([c]) for c in unknown] or [line.words_of(p) for p in unclear]
    quoted = " and ".join(f'"{q}"' for q in dict.fromkeys(quotes or [line.words]))
    if not clear:
        options = ("undo", "a bit further out", "turn it 30 degrees")
        return _as_question(line, f"I do not know what to do with {quoted}. {PLAIN}", options)
    words = [[line.words[c.start : c.end] for c in part] for part in clear]
    understood = ", ".join(" ".join(w for w in part if w not in ",.;!?") for part in words)
    advice = "Say it another way, or leave it out."
    question = f'"{understood}" is clear; I do not know what to do with {quoted}. {advice}'
    return _as_question(line, question, (understood,))


def _is_clear(line: Line, chunks: Sequence[Chunk]) -> bool:
    clauses = line.clauses(chunks)
    return bool(clauses) and all(c.settled for c in clauses)


def _parts(chunks: Sequence[Chunk]) -> list[list[Chunk]]:
    """Return the phrases between separators."""
    found: list[list[Chunk]] = [[]]
    for chunk in chunks:
        if "sep" in chunk.kinds:
            found.append([])
        else:
            found[-1].append(chunk)
    return [p for p in found if any(not is_empty(c) for c in p)]
