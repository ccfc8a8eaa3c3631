"""What a turn does beside edits (undo, go, questions), and edits that need the last ones."""

import re

from .followup_edits import (
    ROWS,
    Effect,
    Effects,
    Utterance,
    ask,
    centre_of,
    is_noun,
    listed,
    refuse,
)
from .followup_frames import Slots
from .followup_teams import BACK_TO, SOME_OF, count
from .followup_things import known
from .followup_words import chunks_of

PUT_BACK = re.compile(r"\b(?:put|bring|add|give|take)\b.*\bback\b", re.IGNORECASE)
STATED, WIDEST = 2.0, 0.11
"""Widest range of a clearance set by a stated distance: px, or a share of the distance."""
CHOSEN = re.compile(r"\bnot\b|\b(?:then|sorry|i mean(?:t)?|rather|instead)\W*$", re.IGNORECASE)
"""Words that mark a choice: "six then", "7, not 5"."""
STATED_BY = ("distance", "spacing", "opening")
"""Kinds of edits by an exact length."""
STEPS = re.compile(r"\b(?:steps?|changes?|edits?|times|plans?|moves)\b", re.IGNORECASE)
CALLED = {
    "swap": ("swap",),
    "turn": ("rotate",),
    "spin": ("rotate",),
    "mirror": ("mirror",),
    "gap": ("opening", "close", "sides"),
    "scale": ("scale",),
    "add": ("add", "count"),
    "remove": ("remove", "count"),
    "apart": ("spacing",),
    "quantity": ("distance", "out", "in", "spacing", "count"),
    "split": ("target",),
    "face": ("heading",),
    "dir": ("shift", "place"),
}
"""Kinds of phrases that name a change, and the kinds of edits that they may mean."""
OF_THEM = re.compile(r"\bof them\b|\b(?:robots|bots|drones|units)\b", re.IGNORECASE)
METRES = re.compile(r"\bmet(?:re|er)s?\b", re.IGNORECASE)
AT_LEAST = re.compile(
    r"\b(?:at least|minimum|no less|not less|(?:no|not) (?:closer|nearer)|"
    r"(?<!no )(?<!not )(?:more|further|farther)(?: away| apart)? than)\b",
    re.IGNORECASE,
)
AT_MOST = re.compile(
    r"\b(?:at most|maximum|no more|not more|(?:no|not) (?:further|farther)|"
    r"(?<!no )(?<!not )(?:less|closer|nearer)(?: together)? than)\b",
    re.IGNORECASE,
)
YES_OR_NO = re.compile(
    r"(?:\W*\b(?:so|and|ok|okay|but|now|well|then|tell me|check|if|whether)\b)*"
    r"\W*(?:is|are|does|has|do(?= (?:they|any|all|the|robots|we|both|two|some|these|those)\b))\b",
    re.IGNORECASE,
)
NOBODY = re.compile(r"\b(?:nobody|no one|none|no robots?)\b", re.IGNORECASE)
SOME = re.compile(r"\b(?:any|anyone|anybody|some)\b", re.IGNORECASE)
MOVES = "undo", "further out", "closer", "turn it 30 degrees"


def _times(slots: Slots, said: Utterance) -> int:
    """Return the number of steps, as given or as often as it is repeated: "undo, undo"."""
    if "num" in slots or "twice" in slots:
        return int(slots.get("num", slots.get("twice", [1]))[0])
    parts = re.split(r"[,;.!]|\band\b|\bthen\b", said.words.lower())
    words = [re.sub(r"\b(?:again|please)\b", "", part).strip() for part in parts]
    return max(1, len([w for w in words if w])) if len({*words} - {""}) == 1 else 1


def undo(slots: Slots, said: Utterance) -> Effects:
    """Go a number of steps back."""
    if "num" in slots and SOME_OF.search(said.words):
        return None
    steps, there = _times(slots, said), said.standing.changes
    if there < steps:
        why = (
            "Nothing was changed yet"
            if not there
            else f"Only {there} change{'s' * (there > 1)} can be taken back"
        )
        return refuse(f"{why}: there is no plan before that. Say what to change instead.")
    return [{"kind": "undo", "steps": steps}]


def returned(slots: Slots, said: Utterance) -> Effects:
    """Go back to the last plan with an arrangement or number of robots: "back to the circle"."""
    named = {"around" if r == "circle" else r for r in slots.get("relation", ())}
    numbers = [int(n) for n in (*slots.get("num", ()), *(1 for _ in slots.get("lone", ())))]
    slots.has("undo", "back", "first", "again")
    gone = sum(e.get("n", len(e.get("ids", ()))) for e in said.last if e["kind"] == "remove")
    if not named and len(numbers) == 1 and numbers[0] < gone and PUT_BACK.search(said.words):
        return [{"kind": "add", "n": numbers[0]}]
    if SOME_OF.search(said.words):
        return None
    for steps, (relations, robots) in enumerate(said.standing.past, 1):
        fits = named <= {*relations} and numbers in ([], [robots])
        if fits and (steps == 1 or named or not numbers) and BACK_TO.search(said.words):
            return [{"kind": "undo", "steps": steps}]
    if named or len(numbers) != 1 or not BACK_TO.search(said.words) or STEPS.search(said.words):
        return None
    last = said.last[-1] if len(said.last) == 1 else {}
    if "px" in last and last["kind"] in STATED_BY:
        return ask(f"{numbers[0]} of what?", f"make it {numbers[0]} px", f"{numbers[0]} robots")
    return count(Slots(num=numbers), said)


def put_back(slots: Slots, said: Utterance) -> Effects:
    """Put robots back to where they were before the last change, if that moved them too."""
    named = {r for row in slots["robots"] for r in row}
    moved = {e.get("robot") for e in said.standing.edits}
    return stay(slots, said) if {None, *named} & moved else None


def undone(slots: Slots, said: Utterance) -> Effects:
    """Take back the last change if it is named by its kind ("undo the swap"), else ask."""
    names = {e for name in CALLED for e in CALLED[name] if name in slots}
    last = [str(e["kind"]) for e in said.standing.edits]
    if {*last} & names:
        return undo(Slots(), said)
    what = f"The last change was of another kind: {listed(last)}." if last else "Nothing to undo."
    return ask(f"{what} Undo that?", "undo") if last else undo(Slots(), said)


def kept(slots: Slots, said: Utterance) -> Effects:
    """Keep a quantity as it is beside a change; in a row the spacing takes an edit of its own."""
    of = str(slots["quantity"][0])
    if re.search(r"\b(?:keep\w*|same|leave|stays?|unchanged)\b", said.words, re.IGNORECASE) is None:
        return None
    if of == "spacing" and said.standing.relation not in ROWS:
        return None  # on a ring, that would take another distance
    keeps = {"kind": "spacing", "factor": 1.0} if of == "spacing" else None
    return [keeps or {"kind": "talk", "about": "already"}]


def moved_back(slots: Slots, said: Utterance) -> Effects:
    """Put robots back to where they were before the last change, if that moved only them."""
    robots = {r for named in slots["robots"] for r in named}
    moved = {e.get("robot") for e in said.last}
    return undo(Slots(), said) if said.last and moved == robots and not said.before else None


def unadded(slots: Slots, said: Utterance) -> Effects:
    """Take back the robots that were added last."""
    slots.used.update(slots)
    counts = [e for e in said.last if e["kind"] in ("add", "count")]
    named = re.search(r"\b(?:those|them|these|they)\b", said.words, re.IGNORECASE)
    fewer = not said.standing.past or said.standing.past[0][1] < said.count
    return undo(Slots(), said) if counts and named and fewer else None


def dont(slots: Slots, said: Utterance) -> Effects:
    """Undo after "no, don't: like before", but not after "don't undo"."""
    called_off = re.match(r"\W*(?:don'?t|do not)\W*[,.;:!-]", said.words, re.IGNORECASE)
    return undo(slots, said) if called_off else None


def redo(slots: Slots, said: Utterance) -> Effects:
    """Go a number of steps forward again."""
    steps = _times(slots, said)
    if said.standing.redo < steps and said.words.lower().split()[:2] == ["undo", "undo"]:
        return undo(Slots(num=[2]), said)
    if said.standing.redo < steps:
        return refuse("There is nothing to make again: nothing was taken back. Say what to change.")
    return [{"kind": "undo", "steps": -steps}]


def first(slots: Slots, said: Utterance) -> Effects:
    """Go back to the first plan."""
    if not said.standing.steps:
        return refuse("No plan stands yet, so there is no first one to go back to.")
    return [{"kind": "undo", "to": "first"}]


def restart(slots: Slots, said: Utterance) -> Effects:
    """Start over: ask what is to be done."""
    return ask(
        "Starting over: which thing, which arrangement and how many robots?",
        "back to the first one",
    )


def go(slots: Slots, said: Utterance) -> Effects:
    """Let the robots move."""
    return [{"kind": "go"}]


def hold(slots: Slots, said: Utterance) -> Effects:
    """Let nothing move until "go"; if robots are named, keep only those where they are."""
    return stay(slots, said) if "robots" in slots else [{"kind": "hold"}]


def stay(slots: Slots, said: Utterance) -> Effects:
    """Keep the robots named where they are."""
    return [{"kind": "stay", "robots": [r for named in slots["robots"] for r in named]}]


def rest_stays(slots: Slots, said: Utterance) -> Effects:
    """Keep all but the robots named before where they are."""
    return [{"kind": "rest"}]


def keep(slots: Slots, said: Utterance) -> Effects:
    """Change nothing, and report that it is so already."""
    return [{"kind": "talk", "about": "already"}]


def steps(slots: Slots, said: Utterance) -> Effects:
    """Report how many steps can be taken back."""
    return [{"kind": "talk", "about": "steps"}]


def bare(slots: Slots, said: Utterance) -> Effects:
    """Read an amount alone: a length or count if the last words tell which, else ask."""
    last = said.last[-1] if len(said.last) == 1 else {}
    exact = "px" in last and last["kind"] in STATED_BY
    if "px" in slots and exact and (said.denies or CHOSEN.search(said.line)):
        return [last | {"px": float(slots["px"][0])}]
    if "px" in slots and slots["px"][0] > 0 and _is_at_length(said):
        return [{"kind": "distance", "px": float(slots["px"][0])}]
    if "px" in slots:
        px = f"{slots['px'][0]:g} px"
        moves = (f"{px} further out", f"{px} closer") if slots["px"][0] > 0 else ()
        return ask(f"{px} of what?", f"{px} away from it", *moves)
    if "num" in slots and exact:
        return [last | {"px": float(slots["num"][0])}]
    if "num" in slots and _is_count(slots["num"][0], said):
        return count(Slots(num=slots["num"]), said)
    if "num" in slots:
        n = f"{slots['num'][0]:g}"
        return ask(f"{n} of what?", f"make it {n} in all", f"{n} more", f"turn it {n} degrees")
    return ask(f'What should change, in "{said.words}"?', *MOVES[1:])


def _is_count(n: float, said: Utterance) -> bool:
    """Return whether a bare number counts robots: they were counted last, or it corrects that."""
    before = chunks_of(said.standing.said, said.standing)
    if any("howmany" in c.kinds for c in before):
        return True
    counted = {e["kind"] for e in said.last} <= {"count"}
    chosen = said.denies or CHOSEN.search(said.line) is not None
    amounts = ("num", "px", "m", "angle", "share")
    spoken = [c.kinds[a] for c in before for a in amounts if a in c.kinds]
    named = n > said.count and OF_THEM.search(said.line) is not None
    chosen = chosen or (spoken == [said.count] and n <= 2 * said.count)
    far = n > 2 * said.count and _is_at_length(said)
    return (named or (counted and chosen and not far)) and len(said.standing.groups) < 2


def _is_at_length(said: Utterance) -> bool:
    """Return whether robots keep a stated distance, and nothing else was changed since."""
    bounds = [g.get("clearance") or (0, 0) for g in said.standing.groups]
    others = {e["kind"] for e in said.last} - {"distance", "count", "add", "remove"}
    return not others and all(0 < high <= low + max(STATED, WIDEST * high) for low, high in bounds)


def refuse_checks(slots: Slots, said: Utterance) -> Effects:
    """Refuse to move robots without the checks."""
    return refuse(
        "Nothing moves without its checks; say what should change, and it is checked at once."
    )


def refuse_through(slots: Slots, said: Utterance) -> Effects:
    """Refuse to drive robots through the thing."""
    return refuse(
        "Robots do not go through a thing, they drive around it. Say where they should stand, "
        "then go."
    )


def units(slots: Slots, said: Utterance) -> Effects:
    """Give lengths in metres if the picture has a scale, else refuse."""
    if said.standing.metres_per_pixel is None:
        return refuse(
            "The picture has no scale, so lengths are px; metres take a picture that was given "
            "with its scale, in metres per pixel."
        )
    return [{"kind": "query", "about": "distance"}]


def sides_free(slots: Slots, said: Utterance) -> Effects:
    """Report which sides no robots stand on."""
    asks = "sideq" in slots or YES_OR_NO.match(said.line)
    return [{"kind": "talk", "about": "sides"}] if asks else None


def _bound(slots: Slots, said: Utterance) -> Effect:
    """Return what a distance is compared with, for a question whether robots keep it."""
    sign = ">" if AT_LEAST.search(said.line) else "<" if AT_MOST.search(said.line) else ""
    if NOBODY.search(said.line):  # "is nobody closer" asks whether all are as far
        sign = {">": "<", "<": ">", "": ""}[sign]
    neighbours = slots.has("apart", "spacing", "num")
    of = "neighbour_px" if neighbours else "target_px"
    some = SOME.search(said.line) is not None
    return {"px": float(slots["px"][0]), "sign": sign, "of": of, "some": some}


def asked(slots: Slots, said: Utterance, about: str) -> Effects:
    """Read a question of the person's that measures answer; `about` is its topic."""
    robots = [r for named in slots.get("robots", ()) for r in named]
    metric = "unit" in slots and METRES.search(said.words)
    if metric and said.standing.metres_per_pixel is None:
        return units(slots, said)
    changes = "radial" in said.phrases[0][0].kinds and about == "distance"  # "out. How far is it?"
    sided = about == "count" and re.search(r"\bleft of\b", said.words.lower())
    asks = about not in ("bound", "at", "touch") or YES_OR_NO.match(said.line)
    if changes or sided or not asks:
        return None
    things = _things_asked(slots, said, about)
    if things is None or (robots and len(things) > 1):
        return None
    if about == "near":
        return _nearest_to_what(slots, said, robots)
    return [
        {"kind": "query", "about": about}
        | _details(slots, said, about)
        | ({"robots": robots} if robots else {})
        | ({"thing": things[-1]} if things else {})
    ]


def _things_asked(slots: Slots, said: Utterance, about: str) -> list[str] | None:
    """Return the things asked about, the first target before another; None if it is not clear."""
    slots.has("thing", "current")
    named = [str(c.kinds.get("thing", c.kinds.get("current", ""))) for c, _ in said.phrases]
    named = [known(name[1:], said.standing) if name[:1] == "?" else name for name in named]
    things = [name for name in dict.fromkeys(named) if name]
    if "each" in slots or about == "near":
        strange = [t for t in things if t[:1] == "?" and not ("each" in slots and is_noun(t[1:]))]
        return None if strange or len(things) > 1 else []
    if len(things) < 2:
        return things if any("thing" in c.kinds for c, _ in said.phrases) else []
    first = said.standing.targets[:1]
    if about != "distance" or len(things) > 2 or "team" in said.kinds or not {*first} & {*things}:
        return None
    return sorted(things, key=lambda thing: thing not in first)


def _details(slots: Slots, said: Utterance, about: str) -> Effect:
    """Return further fields of a query, with `about` if it differs from the frame's name."""
    if about == "distance":
        return {"about": "spacing"} if slots.has("spacing", "apart") else {}
    if about == "at":
        return {"about": "distance"}
    if about == "compared":
        return {"about": "distance", "each": True}
    if about in ("nearest", "pair"):
        return {"most": (slots.get("nearest") or slots.get("pair") or ["nearest"])[0]}
    if about == "touch":
        of_thing = {"thing", "there", "current", "it"} & said.kinds
        return {"about": "nearest" if of_thing else "pair", "most": "nearest", "touch": True}
    return _bound(slots, said) if about == "bound" else {}


def _nearest_to_what(slots: Slots, said: Utterance, robots: list[int]) -> Effects:
    """Ask which robot is nearest to (or furthest from) another one, a point or a centre."""
    query: Effect = {"kind": "query", "about": "near", "most": slots["nearest"][0]}
    slots.has("relation", "inward")
    if robots:
        return [query | {"to": f"robot {robots[0]}"}]
    to = slots["point"][0] if "point" in slots else centre_of(slots, said)
    return None if to is None else [query | {"to": list(to)}]


def tightfit(slots: Slots, said: Utterance) -> Effects:
    """Draw the robots in to the distance that a tight fit has: "as close as you can"."""
    slots.has("all", "radial", "again")
    return [{"kind": "arrange", "demands": {"fit": "tight", "clearance": None}}]


def about_face(slots: Slots, said: Utterance) -> Effects:
    """Have the robots look the opposite way; which way they look has to be known."""
    now = said.standing.groups[0].get("heading")
    turned = {"towards": "away", "away": "towards"}.get(str(now))
    if isinstance(now, (int, float)):
        turned = (now + 180) % 360
    if turned is None or len(said.standing.groups) > 1:
        return ask("Which way are they to look?", "facing out", "facing in")
    return [{"kind": "heading", "to": turned}]
