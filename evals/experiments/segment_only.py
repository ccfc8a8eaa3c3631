"""Segmentation alone (Table II of the paper): a network is given all the words for the thing.

No relation or rank is read, and nothing is compared: the best find is the thing, or without a
network what stands out most. The rules then place robots as if a person had pointed at it.
"""

import json
from dataclasses import replace
from typing import Any

from ...agent.first_message import read_task
from ...agent.messages import Call, History, Reply, Result, User, turn_of
from ...agent.model import Request
from ...agent.offline.accounting import read_instruction
from ...agent.offline.planner import OfflinePlanner
from ...tools.perception.segmenters.registry import segmenter_named

SEGMENT_ONLY = "segment-only"
LONGEST = 60
"""Most characters of a phrase that a network is given."""


class SegmentOnly:
    """A model that takes a network's best find for the words instead of choosing a thing."""

    reads_all = True

    def __init__(self, segmenter: str) -> None:
        self.name = segmenter
        self._by_words = "text" in segmenter_named(segmenter).takes
        self._rules = OfflinePlanner()

    async def reply(self, request: Request) -> Reply:
        """Look for the thing by its words, then let the rules go on with what was found."""
        first, *rest = turn_of(request.messages)
        assert isinstance(first, User)
        if not rest:
            return _call("locate_object", query={"noun": _phrase(first.text)})
        found = _best(tuple(rest), self._by_words)
        if found is None:
            reason = "Nothing was found by the words for the thing."
            return _call("report_impossible", reason=reason)
        pointed = json.dumps([{"id": "t1", "candidate": found}])
        text = "\n".join(
            f"Pointed at: {pointed}" if line.startswith("Pointed at: ") else line
            for line in first.text.split("\n")
        )
        return await self._rules.reply(replace(request, messages=(User(text=text), *rest[2:])))


def _call(name: str, **arguments: Any) -> Reply:
    return Reply(calls=(Call(id=SEGMENT_ONLY, name=name, arguments=arguments),))


def _phrase(text: str) -> str:
    """Return the words for the thing, or all words if the rules find none."""
    said = read_task(text).instruction
    reading = read_instruction(said)
    return (reading.things[0] if reading.things else said)[:LONGEST]


def _best(messages: History, by_words: bool) -> str | None:
    """Return the candidate that the network is surest of; without a network, the most salient."""
    result = next(m for m in messages if isinstance(m, Result) and m.call_id == SEGMENT_ONLY)
    found: list[dict[str, Any]] = []
    if not result.error:
        found = json.loads(result.text)["candidates"]
    scored: list[tuple[float, str]] = (
        [(n["score"], c["id"]) for c in found for n in c.get("named", ())]
        if by_words
        else [(c["salience"], c["id"]) for c in found]
    )
    return max(scored)[1] if scored else None
