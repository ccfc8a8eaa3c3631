"""formup's own loop, model client and tool."""

import numpy as np
from exchange import SYSTEM, USER, compute
from formup.agent.limits import Limits
from formup.agent.loop import run as converse
from formup.agent.messages import User
from formup.agent.model import Model
from formup.agent.outcomes import Answered
from formup.agent.providers.registry import model_named
from formup.tools.context import Context
from formup.tools.perception.image import picture_from_array
from formup.tools.tool import ToolResult, tool
from typed import Point

UNLIMITED = Limits(requests=None, tool_calls=None)
CONTEXT = Context.of(picture_from_array(np.full((20, 20, 3), 60, np.uint8)))
_models: dict[tuple[str, bool], Model] = {}


@tool("read")
async def check_points(context: Context, points: list[Point]) -> ToolResult:
    """Count the points that lie inside the unit circle.

    Args:
        points: the points to check
    """
    return ToolResult({"result": compute((p.x, p.y) for p in points)})


def _nowhere(text: str | None) -> None:
    """Ignore streamed text, which is asked for only so that replies stream."""


def _model(base_url: str, streams: bool) -> Model:
    if (base_url, streams) not in _models:
        show = _nowhere if streams else None
        _models[base_url, streams] = model_named("openai:bench-model", base_url, show=show)
    return _models[base_url, streams]


async def _converse_once(model: Model) -> str:
    first = (User(text=USER),)
    tools = (check_points,)
    outcome = await converse(model, tools, CONTEXT, first, system=SYSTEM, limits=UNLIMITED)
    assert isinstance(outcome, Answered), outcome
    return outcome.text


async def run(base_url: str) -> str:
    """Hold a conversation and return its final text."""
    return await _converse_once(_model(base_url, False))


async def run_stream(base_url: str) -> str:
    """Hold a conversation, streamed, and return its final text."""
    return await _converse_once(_model(base_url, True))
