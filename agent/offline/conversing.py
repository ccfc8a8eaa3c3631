"""The offline planner in a conversation: carries out words about a plan, one tool call at a time.

What was done already is read from the turn's messages, so no state is stored here. A whole new
instruction is left to the planner.
"""

import json
import math
from dataclasses import replace
from typing import Any

from ..first_message import Task, read_task
from ..messages import Call, History, Reply, Result, User
from .amending import repaired
from .answering import arrived, heading_text, query_text, said_of_edit, said_of_undo, talk
from .choosing import Step, calls_in, chosen_candidates, prompts_of
from .correcting import amendments, corrected
from .finding import found_thing, known_thing, measured_at
from .followup import Followup
from .followup_answers import words_meant
from .followup_things import UNNAMED, pointing_at
from .followups import commands, read_followup
from .options import agrees, declines, numbered
from .pointed import shown_now, using_pointed
from .sharing import shared
from .standing import Standing

FEW = 3
"""Most robots whose exact distances are measured to find the nearest."""
LEAST_WAY = 0.02
"""Shortest way that "a bit" is, as a share of the picture's shorter side."""


def conversed(task: Task, turn: History, before: History) -> Reply | tuple[Task, History]:
    """Return the next step of a turn, or the task and messages of a whole new instruction."""
    shown = shown_now(task, before) if task.standing else ()
    task = replace(task, pointed=shown) if shown else task
    standing = _standing(task, before)
    new = standing is not None and any(p["id"] not in task.targets for p in task.pointed)
    words, messages = pointing_at(task.instruction) if new else task.instruction, turn[1:]
    followup = corrected(read_followup(words, standing), words, standing)
    if standing is None and not before and followup.kind != "talk":
        return replace(task, instruction=repaired(words)), turn
    while followup.kind == "ask" or _goes_on(messages, standing, words):
        answer, messages = _answer_to(messages)
        if answer is None:
            offered = {"options": list(followup.options)} if followup.options else {}
            return _calling("ask_user", {"question": _question(followup), **offered})
        if declines(answer):
            return Reply(text="Nothing was changed.")
        words = words_meant(words, followup, answer, standing)
        followup = read_followup(words, standing)
    followup = using_pointed(task, followup) if shown else followup
    if followup.kind == "instruction":
        fresh = words != task.instruction
        said = followup.text if standing else words
        return replace(task, instruction=repaired(said)), (turn[0], *messages) if fresh else turn
    return _with_background(followup, _Steps(task, standing, followup, messages, before).next())


def told_beside(task: Task, words: str, messages: History, before: History) -> Reply | None:
    """Return the next step of answering words that ask about the plan, None if they do not.

    Args:
        words: said while a question was open.
        messages: what followed on them.
    """
    standing = _standing(task, before)
    followup = read_followup(words, standing)
    if followup.kind != "query" and (followup.kind != "talk" or followup.about == "already"):
        return None
    return _Steps(task, standing, followup, messages, before).next()


def _with_background(followup: Followup, reply: Reply) -> Reply:
    """Return the reply; at the end of a turn it also quotes what was read as background."""
    if reply.calls or not followup.background:
        return reply
    quoted = ", ".join(f'"{words}"' for words in followup.background)
    said = f"Read as background, which changes nothing: {quoted}."
    return reply.model_copy(update={"text": f"{reply.text} {said}"})


def _standing(task: Task, before: History) -> Standing | None:
    """Return the current plan with what this turn points at; None if there is no plan."""
    if task.standing is None:
        return None
    pointed = tuple(str(p["id"]) for p in task.pointed)
    points = [p["points"][0] for p in task.pointed if p.get("points")]
    place = (points[0][0], points[0][1]) if points else None
    said = [
        read_task(m.text).instruction if isinstance(m, User) else m.text
        for m in before
        if isinstance(m, User) or (isinstance(m, Result) and m.name == "ask_user" and not m.error)
    ]
    begun = next(
        (read_task(m.text).instruction for m in reversed(before) if isinstance(m, User)), ""
    )
    facts = task.standing
    last: dict[str, Any] = facts.get("last") or {}
    if said and last.get("words") == begun:  # an answer to a question about those words
        facts = facts | {"last": {**last, "words": said[-1]}}
    return Standing.of(
        facts,
        pointed=pointed,
        place=place,
        size=task.size,
        metres_per_pixel=task.metres_per_pixel,
        said=said[-1] if said else "",
    )


def _answer_to(messages: History) -> tuple[str | None, History]:
    """Return the person's first answer to a question, or None, and the messages after it."""
    for k, message in enumerate(messages):
        if isinstance(message, Result) and message.name == "ask_user" and not message.error:
            return message.text, messages[k + 1 :]
    return None, messages


def _goes_on(messages: History, standing: Standing | None, words: str) -> bool:
    """Return whether an answer to "which thing?" chooses none and is a command of its own.

    Or it names a known thing instead of the one in `words` that was asked about.
    """
    answer, later = _answer_to(messages)
    until = messages[: len(messages) - len(later)]
    asked = [c for c in calls_in(until) if c.name == "ask_user"]
    if answer is None or standing is None or not asked[-1].arguments.get("candidates"):
        return False
    chosen = chosen_candidates(until, 1)
    named = amendments(answer, words, standing)
    own = commands(answer, standing) or not all(read_followup(t, standing).things for t in named)
    return (not chosen and own) or _goes_on(later, standing, words)


def _question(followup: Followup) -> str:
    """Return the question with its options numbered."""
    return numbered(followup.text, followup.options) if followup.options else followup.text


class _Steps:
    """The steps that a follow-up takes, one call after another."""

    def __init__(
        self,
        task: Task,
        standing: Standing | None,
        followup: Followup,
        messages: History,
        before: History,
    ) -> None:
        self.task, self.standing, self.followup = task, standing, followup
        self.messages, self.before = messages, before
        self.done = {m.name: m for m in messages if isinstance(m, Result)}

    def next(self) -> Reply:
        """Return the next call, or the text that ends the turn."""
        followup, standing = self.followup, self.standing
        if followup.kind == "refuse":
            return Reply(text=followup.text)
        if standing is None:
            return Reply(text=talk(followup, None, self.before))
        if followup.kind == "talk":
            return Reply(text=talk(followup, standing, self.before))
        if followup.kind == "hold":
            return Reply(text="Nothing moves until you say go.")
        if followup.kind == "query":
            return self._query(standing)
        if followup.kind == "go":
            return self._deploy(standing.plan, "")
        return self._change(standing)

    def _query(self, standing: Standing) -> Reply:
        """Measure what the question is about, then answer it."""
        query: dict[str, Any] = dict(self.followup.query or {})
        results = [m for m in self.messages if isinstance(m, Result) and m.name == "measure"]
        if query["about"] == "heading":
            return Reply(text=heading_text(standing))
        shape, scale = self.done.get("describe_shape"), self.task.metres_per_pixel
        measured = results[0] if results else shape
        robots, thing = query.get("robots", []), str(query.get("thing", ""))
        unnamed = all(label.startswith(UNNAMED) for _, label in standing.things)
        if thing.startswith("?") and unnamed and len(standing.things) == 1:
            thing = standing.things[0][0]
        if thing.startswith("?"):
            return Reply(text=f'"{thing[1:]}" is not measured yet: point at it, and ask again.')
        if measured is not None and measured.error:
            return Reply(text=measured.text)
        if measured is not None:
            data = json.loads(measured.text)
            if query["about"] == "nearest" and thing and standing.targets != [thing]:
                return self._nearest_to(thing, data, standing, query)
            return Reply(text=query_text(query, data, scale))
        two = len(robots) == 2 and "each" not in query
        if (thing or two) and query["about"] in ("distance", "spacing"):
            ends = [*(f"r{r}" for r in robots), *([thing] if thing else [])]
            ends = ends if len(ends) > 1 else [standing.targets[0], *ends]
            return _calling("measure", {"a": ends[0], "b": ends[1]})
        if query["about"] == "size" and (thing or standing.targets):
            return _calling("describe_shape", {"target": thing or standing.targets[0]})
        return _calling("measure", {"a": "plan"})

    def _nearest_to(
        self, thing: str, data: dict[str, Any], standing: Standing, query: dict[str, Any]
    ) -> Reply:
        """Measure the few robots nearest to (or furthest from) another thing, then answer."""
        centre, sign = (standing.centre or {})[thing], -1 if query["most"] == "furthest" else 1
        rows = sorted(data["each"], key=lambda r: sign * math.dist(r["place"], centre))[:FEW]
        measured = [m for m in self.messages if isinstance(m, Result) and m.name == "measure"][1:]
        if len(measured) < len(rows):
            return _calling("measure", {"a": f"r{rows[len(measured)]['robot']}", "b": thing})
        ways = [json.loads(m.text).get("nearest_px", math.inf) for m in measured]
        seen = [r | {"target": thing, "target_px": w} for r, w in zip(rows, ways, strict=True)]
        return Reply(text=query_text(query, {"each": seen}, self.task.metres_per_pixel))

    def _change(self, standing: Standing) -> Reply:
        """Find things, take back, measure and edit; then move robots if asked, and report."""
        followup, failed = self.followup, self.done.get("edit_formation")
        ids: dict[str, str] = {}
        prompts: list[dict[str, Any]] = []
        for phrase in followup.things:
            found = known_thing(phrase, standing, self.messages) or found_thing(
                phrase, standing, self.messages
            )
            if isinstance(found, str):
                ids[f"?{phrase}"] = found
                continue
            if isinstance(found, Step):
                return _calling(found.name, found.arguments)
            known = [name for name, _ in standing.things]
            there = measured_at(found.candidate, standing.centre or {}, self.messages)
            if there is not None:
                ids[f"?{phrase}"] = there
                continue
            taken = [*known, *standing.pointed, *(p["id"] for p in prompts)]
            label = found.wording.removeprefix("the ")[:100]
            prompt = prompts_of([(found.candidate, label)], self.before, taken)[0]
            ids[f"?{phrase}"] = prompt["id"]
            prompts += [prompt] if prompt["id"] not in known else []
        undone = self.done.get("undo")
        if (followup.undo or followup.to) and undone is None:
            return _calling(
                "undo", {"to": followup.to} if followup.to else {"steps": followup.undo}
            )
        if undone is not None and (undone.error or not followup.edits):
            return Reply(
                text=undone.text
                if undone.error
                else said_of_undo(followup, json.loads(undone.text), self.task.metres_per_pixel)
            )
        if failed is None:
            return self._edit(ids, prompts)
        if failed.error:
            return self._failed(failed, taken_back=undone is not None)
        return self._after(failed)

    def _edit(self, ids: dict[str, str], prompts: list[dict[str, Any]]) -> Reply:
        edits = [dict(edit) for edit in self.followup.edits]
        if any(isinstance(edit.get("by"), dict) for edit in edits):
            measured = self.done.get("measure")
            if measured is None:
                return _calling("measure", {"a": "plan"})
            assert self.standing is not None
            edits = [_as_xy(edit, json.loads(measured.text), self.standing) for edit in edits]
        named = json.dumps(edits)
        for phrase, name in ids.items():
            named = named.replace(json.dumps(phrase), json.dumps(name))
        prompts += [
            p
            for p in self.task.pointed
            if json.dumps(p["id"]) in named and p["id"] not in self.task.targets
        ]
        meant = [e for e in json.loads(named) if not self._stands_there(e)]
        if not meant:
            return Reply(text="The robots stand around that already; nothing is changed.")
        arguments: dict[str, Any] = {"edits": meant}
        arguments |= {"targets": prompts} if prompts else {}
        arguments |= {"stay": list(self.followup.stay)} if self.followup.stay else {}
        return _calling("edit_formation", arguments)

    def _stands_there(self, edit: dict[str, Any]) -> bool:
        """Return whether an edit moves all robots to the thing they stand about already."""
        assert self.standing is not None
        alone = len(self.standing.groups) == 1 and "robots" not in edit
        return alone and edit["kind"] == "target" and [edit["to"]] == self.standing.targets

    def _failed(self, failed: Result, *, taken_back: bool) -> Reply:
        """Report or ask why nothing is changed, after redoing what was taken back for the edit."""
        undos = sum(isinstance(m, Result) and m.name == "undo" for m in self.messages)
        found = shared(failed, self.messages) if failed.cause == "no_order" else ""
        if isinstance(found, Step):
            return _calling(found.name, found.arguments)
        if taken_back and undos == 1:
            return _calling("undo", {"steps": -self.followup.undo})
        said = found or (failed.facts or {}).get("plain", failed.text)
        if failed.cause == "low_confidence":
            return _calling("ask_user", {"question": said})
        return _calling("report_impossible", {"reason": said})

    def _after(self, made: Result) -> Reply:
        data = json.loads(made.text)
        if not data.get("certified", True):
            return _calling(
                "report_impossible",
                {"reason": " ".join(data["findings"]), "plan_id": data["plan_id"]},
            )
        told = said_of_edit(data, self.task.metres_per_pixel)
        if self.followup.rest:
            answer, _ = _answer_to(self.messages)
            if answer is None:
                return _calling(
                    "ask_user",
                    {"question": f'{told} Next: "{self.followup.rest}". Shall I? 1: yes; 2: no.'},
                )
            return self._later(answer, told)
        if (self.followup.go or self.task.deploy) and not self.followup.hold:
            return self._deploy(data["plan_id"], told)
        return Reply(text=f"{told} Nothing was moved.")

    def _later(self, answer: str, told: str) -> Reply:
        """Take the second step of a sequence once it is confirmed, or what is said instead."""
        assert self.standing is not None
        confirmed = agrees(answer) or answer.strip(" .") == "1"
        if declines(answer) or answer.strip(" .") == "2":
            return Reply(text=f"{told} Nothing more was changed.")
        words = self.followup.rest if confirmed else answer
        now = replace(self.standing, edits=self.followup.edits, words="")
        following = read_followup(words, now)
        after = next(
            k for k, m in enumerate(self.messages) if isinstance(m, Result) and m.name == "ask_user"
        )
        if following.kind in ("ask", "instruction"):
            alone = "Say that as a turn of its own."
            return Reply(text=f"{told} {following.text if following.kind == 'ask' else alone}")
        return _Steps(self.task, now, following, self.messages[after + 1 :], self.before).next()

    def _deploy(self, plan: str, told: str) -> Reply:
        result = self.done.get("deploy")
        if result is None:
            return _calling("deploy", {"plan_id": plan})
        text = (
            result.text
            if result.error
            else arrived(json.loads(result.text), self.task.metres_per_pixel)
        )
        return Reply(text=f"{told} {text}".strip())


def _as_xy(edit: dict[str, Any], measured: dict[str, Any], standing: Standing) -> dict[str, Any]:
    """Return an edit with a robot's way out from its target, or in, turned into x and y, px."""
    if not isinstance(edit.get("by"), dict):
        return edit
    by: dict[str, float] = edit["by"]
    row = next(r for r in measured["each"] if r["robot"] == str(edit["robot"]))
    centre = (standing.centre or {}).get(row.get("target", ""), (0.0, 0.0))
    x, y = row["place"][0] - centre[0], row["place"][1] - centre[1]
    length = max((x * x + y * y) ** 0.5, 1e-9)
    way = by.get("out", -by.get("in", 0.0)) / length
    if "factor" in by:  # "a bit": a share of its distance
        least = LEAST_WAY * min(standing.size)
        share = max((by["factor"] - 1) * row.get("target_px", 0.0), least)
        way = math.copysign(min(abs(way * length), share), way) / length
    return edit | {"by": [round(x * way, 2), round(y * way, 2)]}


def _calling(name: str, arguments: dict[str, Any]) -> Reply:
    return Reply(calls=(Call(id="call", name=name, arguments=arguments),))
