"""Finds the robot meant by its place: "the leftmost robot", "the second one from the top".

Its number replaces the phrase, so that whatever can be said of robot 3 can be said of it too.
"""

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..first_message import Task
from ..messages import Call, History, Reply, Result
from .choosing import calls_in
from .followup_edits import listed
from .followup_words import table_of
from .standing import Standing

AMOUNTS = {"two": 2, "2": 2, "three": 3, "3": 3, "four": 4, "4": 4}
LEAST_APART, APART, NEAR_APART = 1.0, 0.02, 0.15
"""Robots closer than this in px, or as a share of the whole extent, tie; third: near a thing."""
CLEARLY = 0.2
"""Share of the whole extent by which robots on a side are further there than any others."""
MOST_OFFERED = 12
TOWARDS = {
    **dict.fromkeys(("left", "west"), (-1, 0)),
    **dict.fromkeys(("right", "east"), (1, 0)),
    **dict.fromkeys(("top", "upper", "upp", "high", "north"), (0, -1)),
    **dict.fromkeys(("bottom", "lower", "low", "south"), (0, 1)),
}
BOT = r"(?:robot|bot|drone|rover|unit|machine|lad|guy|fella|fellow|chap|boy|man)"
END = r"(?:left|right|top|bottom|upper|lower|north|south|east|west)"
MIDDLE = r"(?:middle|centre|center|central|cent(?:re|er)most|middlemost)"
MOST = (
    r"(?:(?:left|right|top|upper|bottom|lower|north|south|east|west)(?:ern)?-?most|highest|lowest)"
)
WAY = rf"(?:{MOST}|{MIDDLE}|{END}(?:[- ]?hand)?(?:[- ]{END})?)"
FAR = r"(?:(?:very|far|furthest|farthest|extreme|most|all the way|outer|exact) )"
NOUN = rf"(?:{BOT}(?P<many>s)?|(?P<one>ones?))\b(?! [0-9]+\b(?! ?(?:px|pix|m\b|met|cm|%|deg|per)))"
N = rf"(?:(?P<n>{'|'.join(AMOUNTS)}) )?"
RANKS = "second|2nd|third|3rd|fourth|4th|fifth|5th"
RANK = rf"(?:(?:(?P<rank>{RANKS})|last|end|outermost) )?"
CORNER = r"(?: (?:corner|side|end|edge))?+(?: of (?:all|them|them all))?+"
STANDS = r"(?:(?:(?:that|which|who)(?:'s| is| stands| sits)?|standing|sitting|placed) )?"
NEAR = r"(?:nearest|closest|next|near|close)(?: to)? (?:the )?"
AT = (
    rf"(?:(?:at|on|in) (?:the )?|to (?:the )?(?=very|far|extreme)|(?=furthest|farthest|most)){FAR}?"
    rf"(?:(?:to|on|at|in) (?:the )?)?{FAR}?"
)
PHRASES = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        rf"\b(?P<which>which|what|who)(?: of (?:them|the {BOT}s))?(?: (?:one|number|{BOT}))?"
        rf"(?:'s| is| has| stands| sits)(?: the number of)? (?:the )?(?:(?:one|{BOT}) )?"
        rf"(?:{AT}|{FAR})?(?P<way>{WAY})(?: (?:one|{BOT}))?{CORNER}(?=\W*$| now| at the moment)",
        rf"\b(?:the |(?={MOST})){N}{RANK}{FAR}?(?P<way>{WAY})(?: corner| side| end)? {NOUN}"
        rf"(?! (?:of|(?:on|at|in) the {END})\b)",
        rf"\b(?:the |that ){N}{RANK}{NOUN} {STANDS}(?:(?:counted )?from (?:the )?|{NEAR}|{AT})"
        rf"(?P<way>{WAY})\b{CORNER}(?! (?:of|{BOT}))",
        rf"\bthe (?P<way>{MOST})(?P<one>)"
        r"(?=\W*$|[,;.]| (?:[0-9]+|an? |by |should|must|has|further|farther|closer|out|in|up|down|"
        r"away|to|from|is|goes|and (?:the|robot))\b)",
        rf"\bthe (?P<rank>{RANKS})(?P<one>) from (?:the )?(?P<way>{END})\b{CORNER}",
        rf"\b(?:everyone|everybody|anyone|those|all (?:of them|the {BOT}s)?)(?P<many>) {STANDS}"
        rf"(?:{NEAR}|{AT})(?P<way>{WAY})\b{CORNER}(?! (?:of|{BOT}))",
        rf"(?:^|\bthe |[,;] ?|\band )(?P<way>{WAY}) (?P<n>{'|'.join(AMOUNTS)})(?P<one>)"
        rf"(?! (?:{BOT}|px|pix|m\b|metre|meter|cm|robots|more|things))(?=\W|$)",
        rf"\bthe (?P<n>{'|'.join(AMOUNTS)})(?P<one>) {STANDS}(?:{NEAR}|{AT})"
        rf"(?P<way>{WAY})\b{CORNER}(?! (?:of|{BOT}))",
    )
)
"""Phrases for robots by where they stand; with the group `one`, for robots or things."""
SAYS_ALL = re.compile(r"\b(?:everyone|everybody|all|only|just)\b", re.IGNORECASE)
"""Words with which a side may be where all robots are to stand."""
NEAREST = re.compile(
    r"\b(?:the|that|whoever|whichever)\b.*\b(?:nearest|closest|next|furthest|farthest)\b",
    re.IGNORECASE,
)
"""Words that may name a robot by how near it is to a thing."""
BOTH = re.compile(
    rf"\bthe (?P<a>{FAR}?{WAY}) and (?:the )?(?P<b>{FAR}?{WAY}) (?P<noun>{BOT}|one)s?\b",
    re.IGNORECASE,
)
"""Two robots of one noun: "the left and the right robot"."""
LED = re.compile(
    r"\b(?:around|round|about|to|towards?|inside|between|by|near|along|from|of|at|on|onto) $"
)
"""After these words "the left one" is a thing."""


@dataclass(frozen=True)
class Named:
    """Words in which robots are named by their numbers.

    Attributes:
        words: the text, unchanged where no robot is meant by its place.
        tied: the first phrase that does not settle which robot is meant, or "".
        options: the text with each robot that fits `tied`; empty if there are too many.
        robots: the robots that fit `tied`.
        example: the text with robots that may be meant, to see whether it makes sense.
    """

    words: str
    tied: str = ""
    options: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()
    example: str = ""

    @property
    def question(self) -> str:
        """The question which of the robots that fit is meant."""
        if len(self.options) == 1:
            return f'Which robots are "{self.tied}"? By where they stand {listed(self.robots)}.'
        fitting = f'"{self.tied}" fits {listed(self.robots)} alike'
        return f"Which robot is meant? {fitting}: name it by its number."


def speaks_of_place(words: str) -> bool:
    """Return whether words may name a robot by where it stands."""
    return any(pattern.search(words) for pattern in (*PHRASES, NEAREST))


def numbered(standing: Standing) -> Standing:
    """Return the current plan with robots numbered in the words that led to it."""
    words, said = (
        named(text, standing, ones=True).words for text in (standing.words, standing.said)
    )
    return replace(standing, words=words, said=said)


def meant_by_place(words: str, standing: Standing, clear: Callable[[str], bool]) -> Named:
    """Return words with robots numbered; "the top one" is a robot if they are `clear` only then."""
    robots = named(words, standing, ones=False)
    several = robots.words != words or (robots.tied and len(robots.options) == 1)
    if several and SAYS_ALL.search(words) and clear(words):  # "everyone on the left"
        return Named(words)
    if robots.tied or clear(robots.words):
        return robots
    either = named(robots.words, standing, ones=True)
    return either if clear(either.example or either.words) else robots


def named(words: str, standing: Standing, *, ones: bool) -> Named:
    """Return the words with numbers for robots that are meant by their places in the plan.

    Args:
        words: the person's words.
        standing: the current plan, with the places of its robots.
        ones: whether "the left one" is a robot too.
    """
    words = BOTH.sub(r"the \g<a> \g<noun> and the \g<b> \g<noun>", words)
    for pattern in (*PHRASES, *_by_things(standing)):
        at = 0
        while (match := pattern.search(words, at)) is not None:
            said, at = match.groupdict(), match.end()
            thing = said.get("one") is not None
            some = said.get("many") is not None or str(said.get("one") or "").endswith("s")
            if thing and (not ones or LED.search(words[: match.start()].lower())):
                continue
            if some and not said.get("n"):
                there, sure = _on_a_side(str(said["way"]).lower(), standing)
                if not there or said.get("which"):
                    continue
                text = f"{words[: match.start()]}{_called(there)}{words[match.end() :]}"
                if not sure:
                    return Named(words, match[0], (text,), there, text)
                words, at = text, match.start() + len(_called(there))
                continue
            chosen, rivals = _ranked(said, standing)
            lead = "where is " if said.get("which") else ""
            fit = sorted({*chosen, *rivals}, key=lambda robot: (len(robot), robot))
            put = [f"{lead}{_called(chosen)}"] if chosen else []
            if rivals and len(chosen) == 1:
                put = [f"{lead}{_called([robot])}" for robot in _in_places(fit)]
            texts = tuple(f"{words[: match.start()]}{p}{words[match.end() :]}" for p in put)
            if rivals or not chosen:
                few = texts if 1 < len(texts) <= MOST_OFFERED else ()
                return Named(words, match[0], few, tuple(fit), next(iter(texts), words))
            words, at = texts[0], match.start() + len(put[0])
    return Named(words)


def with_places(task: Task, turn: History) -> Reply | tuple[Task, History]:
    """Return the task with the robots' places if words refer to them, or first the measure call."""
    answers = [m.text for m in turn if isinstance(m, Result) and m.name == "ask_user"]
    if task.standing is None or not any(map(speaks_of_place, [task.instruction, *answers])):
        return task, turn
    measured = next((m for m in turn if isinstance(m, Result) and m.name == "measure"), None)
    if measured is None:
        return Reply(calls=(Call(id="call", name="measure", arguments={"a": "plan"}),))
    asked = next(c for c in calls_in(turn) if c.id == measured.call_id)
    kept = tuple(
        m for m in turn if m is not measured and not (isinstance(m, Reply) and asked in m.calls)
    )
    data: dict[str, Any] = {} if measured.error else json.loads(measured.text)
    each = data.get("each", ())  # of many robots only the first are listed
    places = {row["robot"]: row["place"] for row in each if len(each) == data["robots"]}
    return replace(task, standing=task.standing | {"places": places}), kept


def _ranked(
    said: Mapping[str, str | None], standing: Standing
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the robots that are meant, and others that fit as well."""
    need = AMOUNTS.get((said.get("n") or "").lower(), 1)
    skip = table_of("ordinals").get((said.get("rank") or "first").lower(), 1) - 1
    far = _scores(str(said["way"]).lower(), standing)
    if said.get("far"):
        far = {robot: -score for robot, score in far.items()}
    order = sorted(far, key=lambda robot: -far[robot])
    chosen = tuple(order[skip : skip + need])
    near = _centre(str(said["way"]), standing) is not None  # its extent is not known here
    least = max(LEAST_APART, (NEAR_APART if near else APART) * (far[order[0]] - far[order[-1]]))
    ends = [far[robot] for robot in (*chosen[:1], *chosen[-1:])]
    others = [robot for robot in order if robot not in chosen]
    rivals = tuple(r for r in others if any(abs(far[r] - end) < least for end in ends))
    return (chosen, rivals) if len(chosen) == need else ((), rivals)


def _by_things(standing: Standing) -> tuple[re.Pattern[str], ...]:
    """Return patterns for robots by how near they are to a thing: "the one nearest the tree"."""
    names = [name for thing in standing.things for name in thing if _centre(name, standing)]
    if not names or not standing.places:
        return ()
    way = rf"(?P<way>{'|'.join(map(re.escape, sorted(names, key=len, reverse=True)))})\b"
    near = r"(?:(?:nearest|closest|next)(?: to)?|(?P<far>furthest|farthest)(?: away)?(?: from)?)"
    return (
        re.compile(rf"\b(?:the |that ){N}{NOUN} {STANDS}{near} (?:the )?{way}", re.IGNORECASE),
        re.compile(
            rf"\b(?:(?:whoever|whichever) is|the)(?: (?P<n>{'|'.join(AMOUNTS)}))?(?P<one>) "
            rf"{near} (?:the )?{way}",
            re.IGNORECASE,
        ),
    )


def _centre(name: str, standing: Standing) -> tuple[float, float] | None:
    """Return the centre of a thing by its id or label, px; None if it is no such name."""
    centres = standing.centre or {}
    ids = [t for t, label in standing.things if name.lower() in (t.lower(), label.lower())]
    return centres.get(ids[0]) if len(ids) == 1 else None


def _on_a_side(way: str, standing: Standing) -> tuple[tuple[str, ...], bool]:
    """Return the robots whose way from the middle of all is nearest to a side's, and if surely."""
    places, ends = standing.places or {}, re.findall(END, way)
    if len(ends) != 1 or not places:
        return (), False
    x, y = (sum(at[k] for at in places.values()) / len(places) for k in (0, 1))
    dx, dy = TOWARDS[ends[0]]
    off = {r: (at[0] - x, at[1] - y) for r, at in places.items()}
    there = [
        r for r, (a, b) in off.items() if a * dx + b * dy > abs(a * dy) + abs(b * dx) - LEAST_APART
    ]
    far = {r: a * dx + b * dy for r, (a, b) in off.items()}
    there = [r for r in there if far[r] > LEAST_APART]
    if len(there) < 2:  # of a few robots, or of a row across it
        there = [r for r in far if far[r] > max(LEAST_APART, max(far.values()) / 2)]
    if len(there) in (0, len(places)):
        return (), False
    others = max(score for r, score in far.items() if r not in there)
    apart = min(far[r] for r in there) - others
    return tuple(there), apart > CLEARLY * (max(far.values()) - min(far.values()))


def _in_places(robots: Sequence[str]) -> list[str]:
    """Order robots so that, say, the third option is robot 3 if that is one of them."""
    own = {int(r): r for r in robots if r.isdecimal() and int(r) <= len(robots)}
    rest = iter([robot for robot in robots if robot not in own.values()])
    return [own.get(k) or next(rest) for k in range(1, len(robots) + 1)]


def _scores(way: str, standing: Standing) -> dict[str, float]:
    """Return how far each robot is towards a side or corner, or in the middle, px."""
    places = standing.places or {}
    x, y = (sum(at[k] for at in places.values()) / max(len(places), 1) for k in (0, 1))
    if re.fullmatch(MIDDLE, way):
        return {r: -(((at[0] - x) ** 2 + (at[1] - y) ** 2) ** 0.5) for r, at in places.items()}
    centre = _centre(way, standing)
    if centre is not None:
        return {r: -math.dist(at, centre) for r, at in places.items()}
    ends = re.findall(rf"{END}|high|low", way)
    vectors = [TOWARDS[end] for end in ends]
    dx, dy = (sum(v[k] for v in vectors) for k in (0, 1))
    return {r: dx * at[0] + dy * at[1] for r, at in places.items()}


def _called(robots: Sequence[str]) -> str:
    """Return robots named by their numbers: "robots 2 and 3"."""
    return f"robot{'s' * (len(robots) > 1)} {listed(robots)}"
