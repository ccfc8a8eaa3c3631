"""ZeroCAP as in the paper, as one model around two: object and pattern, mask, shape, coordinates.

Code calls the two tools between the models. There is no contract, no certificate and no second
try: robots are sent where the planner writes. A mask below the threshold ends it, as in the paper.
"""

import json
from typing import Any

from ...agent.messages import Call, Reply, Result, User, turn_of
from ...agent.model import Model, Request
from ...prompts import Prompt
from ...tools.builtin import TOOLS
from .written import json_object

ZEROCAP = "zerocap"
OBJECT, PLACES = "zerocap-object", "zerocap-places"
"""The prompts of the two stages."""
CALLED = tuple(tool for tool in TOOLS if tool.name in ("segment", "describe_shape"))
PLANNER_LINES = ("Robots", "Picture", "Metres per pixel")
"""Lines of the first message that the planner is given unchanged."""
INSUFFICIENT = json.dumps({"positions": [], "reason": "Insufficient segmentation accuracy."})
LONGEST = 60
"""Most characters of a phrase that a network is given."""


class ZeroCap:
    """A model that sees, combined with one that writes coordinates.

    Args:
        looker: is given the picture and the person's words.
        planner: is given the pattern, the number of robots and the shape, but no picture.
        look: the looker's prompt.
        place: the planner's prompt.
        by_text: whether the segmenter is given the object's name; else the looker's box.
    """

    reads_all = sees = True

    def __init__(
        self, looker: Model, planner: Model, look: Prompt, place: Prompt, *, by_text: bool
    ) -> None:
        self.name = looker.name if planner is looker else f"{looker.name}+{planner.name}"
        self._looker, self._planner, self._look, self._place = looker, planner, look, place
        self._by_text = by_text

    async def reply(self, request: Request) -> Reply:
        """Return the looker's reply, then a call of each tool, then the planner's reply."""
        first, *rest = turn_of(request.messages)
        if not rest:
            seen = await self._looker.reply(Request(self._look.render(), (first,), ()))
            found = json_object(seen.text)
            if not isinstance(found.get("object"), str):
                return seen
            return seen.model_copy(update={"calls": (self._segment(found),), "opaque": None})
        last = rest[-1]
        assert isinstance(last, Result)
        if last.error is not None:
            return Reply(text=INSUFFICIENT)
        if last.name == "segment":
            return Reply(
                calls=(Call(id="shape", name="describe_shape", arguments={"target": "t1"}),)
            )
        looked = rest[0]
        assert isinstance(looked, Reply)
        pattern = json.dumps(json_object(looked.text).get("pattern"), ensure_ascii=False)
        facts = [line for line in first.text.split("\n") if line.partition(":")[0] in PLANNER_LINES]
        message = User(text="\n".join([f"Pattern: {pattern}", *facts, f"Shape: {last.text}"]))
        return await self._planner.reply(Request(self._place.render(), (message,), ()))

    async def aclose(self) -> None:
        """Close what either model keeps open."""
        for model in {id(m): m for m in (self._looker, self._planner)}.values():
            close = getattr(model, "aclose", None)
            if close is not None:
                await close()

    def _segment(self, found: dict[str, Any]) -> Call:
        named = found["object"][:LONGEST]
        prompt = {"text": named} if self._by_text else {"box": found.get("box")}
        return Call(id="mask", name="segment", arguments={"id": "t1", "label": named} | prompt)
