"""The cost of a conversation in tokens, counted in the same way whoever answered it.

Text: four characters per token, a rule of thumb for any provider's tokenizer. Pictures: as
Anthropic bills them, width times height / 750 after the long side is scaled down to 1,568 px
(their guide to vision, 2026). Each request is paid in full, or with its prompt and tools at a
tenth, the price of what is in the cache.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO

from PIL import Image

from ...agent.messages import History, Reply, Result, User
from ...tools.tool import Tool

CHARACTERS, PIXELS, LONG = 4, 750, 1568
CACHED, CACHEABLE = 0.1, 1024
"""Price of a token read from the cache as a share, and the shortest prefix that is cached, tokens
(Anthropic, 2026)."""


@dataclass(frozen=True)
class Spent:
    """Requests made, and tokens over all of them.

    Attributes:
        cached: input in tokens of full price, if the prompt and the tools were in the cache.
    """

    requests: int
    input: int
    output: int
    cached: int


def spent(messages: History, system: str = "", tools: Sequence[Tool] = ()) -> Spent:
    """Return what all the replies of a conversation have cost.

    Args:
        messages: the conversation.
        system: the prompt that every request began with.
        tools: those every request offered.
    """
    prefix = text_tokens(system) + _offered(tuple(tools))
    sent, requests, paid, output = prefix, 0, 0, 0
    for message in messages:
        size = _size(message)
        if isinstance(message, Reply):
            requests, paid, output = requests + 1, paid + sent, output + size
        sent += size
    saved = (1 - CACHED) * prefix * requests if prefix >= CACHEABLE else 0
    return Spent(requests, paid, output, paid - round(saved))


@lru_cache(maxsize=8)  # a sweep offers the same tools in every trial
def _offered(tools: tuple[Tool, ...]) -> int:
    offered = [{"name": t.name, "description": t.description, "schema": t.offered} for t in tools]
    return text_tokens(_json(offered)) if offered else 0


def text_tokens(text: str) -> int:
    """Return the tokens of a text."""
    return math.ceil(len(text) / CHARACTERS)


def picture_tokens(width: int, height: int) -> int:
    """Return the tokens of a picture of this size, px."""
    factor = min(1.0, LONG / max(width, height))
    return math.ceil(width * factor * height * factor / PIXELS)


def _size(message: User | Reply | Result) -> int:
    if isinstance(message, Reply):
        calls = [{"name": c.name, "arguments": c.arguments} for c in message.calls]
        return text_tokens(message.text) + (text_tokens(_json(calls)) if calls else 0)
    shown = 0
    for image in message.images:
        with Image.open(BytesIO(image)) as opened:
            shown += picture_tokens(*opened.size)
    return text_tokens(message.text) + shown


def _json(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False)
