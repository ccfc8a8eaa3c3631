"""The detector `vlm`: the model that decides, asked where the things are that a noun names.

A tool waits for it in its thread while the request runs in the turn's event loop. The answer is a
proposal like any other detector's: boxes, which code measures, no more certain than it says.
"""

import asyncio
import json
from collections.abc import Generator
from concurrent.futures import Future
from contextlib import contextmanager

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ...prompts import PromptLibrary
from ...tools.context import BESIDE, Context, Settings
from ...tools.draw import draw_view
from ...tools.errors import InputError, ToolError
from ...tools.perception.detection import Detection
from ...tools.perception.detectors.vlm import VlmDetector
from ...tools.perception.image import picture_from_array
from ...tools.perception.segmenters.protocol import Pixels
from ...tools.perception.target_prompt import Box, box_problems
from ...tools.world import World
from ..messages import Aside, User
from ..model import Model, Request, reply_in_time
from .two_stages import prompt_named

PROMPT = "find"
MOST = 0.65
"""Most confidence in an outline within its boxes, so that robots are not sent there unseen."""


class _Thing(BaseModel):
    model_config = ConfigDict(allow_inf_nan=False)

    box: Box
    score: float = Field(ge=0, le=1)


class _Things(BaseModel):
    things: list[_Thing]


class ModelFinder(VlmDetector):
    """A model as a detector, within a running event loop.

    Args:
        model: a model that sees.
        library: where its prompt is taken from.
        seconds: how long a reply may take; None is no limit.
    """

    def __init__(self, model: Model, library: PromptLibrary, seconds: float | None) -> None:
        self._model, self._seconds = model, seconds
        self._system = prompt_named(library, PROMPT).render()
        self._loop = asyncio.get_running_loop()
        self._waiting: set[Future[Aside]] = set()
        self._asked: list[Aside] = []
        self._over = False

    def find(self, pixels: Pixels, phrase: str) -> tuple[Detection, ...]:
        """See `Finder.find`; not to be called from the event loop's own thread.

        Raises:
            ModelError: there is no reply.
            ToolError: the reply cannot be read or has no box in the picture, or the turn is over.
        """
        picture = picture_from_array(pixels)
        image = draw_view(picture, World.of(picture))
        if self._over:  # the tool was given up, but still works
            return super().find(pixels, phrase)
        height, width = pixels.shape[:2]
        text = f"Find: {json.dumps(phrase, ensure_ascii=False)}\nPicture: {width} x {height} px"
        message = User(text=text, images=(image,))
        asking = asyncio.run_coroutine_threadsafe(self._ask(message), self._loop)
        self._waiting.add(asking)
        said = asking.result().reply.text
        try:
            found = _Things.model_validate_json(said[said.find("{") : said.rfind("}") + 1]).things
        except ValidationError:
            raise self._useless(phrase, "in no form that can be read") from None
        far = np.array((width, height, width, height)) - 1
        seen = [thing for thing in found if not box_problems(thing.box, width, height)]
        if found and not seen:
            raise self._useless(phrase, "with boxes that are none in this picture")
        made = (
            Detection((x0, y0, x1, y1), thing.score, most=min(thing.score, MOST))
            for thing in sorted(seen, key=lambda thing: -thing.score)
            for x0, y0, x1, y1 in [np.clip(thing.box, 0, far).tolist()]
        )
        return tuple(made)

    def taken(self) -> tuple[Aside, ...]:
        """Return what was asked since the last time, and give up what is still waited for."""
        for asking in self._waiting:
            asking.cancel()
        asked, self._asked, self._waiting = tuple(self._asked), [], set()
        return asked

    def close(self) -> None:
        """Stop asking: the turn is over."""
        self._over = True
        self.taken()

    async def _ask(self, message: User) -> Aside:
        request = Request(self._system, (message,), (), aside=True)
        reply = await reply_in_time(self._model, request, self._seconds)
        asked = Aside(
            text=message.text, reply=reply.model_copy(update={"opaque": None, "calls": ()})
        )
        self._asked.append(asked)
        return asked

    def _useless(self, phrase: str, how: str) -> ToolError:
        return ToolError(
            f'{self._model.name}, asked where "{phrase}" is, answered {how}: point with an '
            "outline, a box or points."
        )


@contextmanager
def asking(
    context: Context, model: Model, library: PromptLibrary, seconds: float | None
) -> Generator[ModelFinder | None]:
    """Yield the model as a turn's detector if the settings want that, else None."""
    finder = ModelFinder(model, library, seconds) if _uses_model_finder(context.settings) else None
    try:
        yield finder
    finally:
        if finder is not None:
            finder.close()


def check_sees(settings: Settings, model: Model) -> None:
    """Refuse a detector that asks the model if the model does not see.

    Raises:
        InputError: the settings have such a detector, and the model does not see.
    """
    if _uses_model_finder(settings) and not getattr(model, "sees", False):
        raise InputError(
            f"The detector {VlmDetector.name!r} asks the model that decides, and {model.name} sees "
            "no picture; choose a model such as openai:NAME, or another detector."
        )


def _uses_model_finder(settings: Settings) -> bool:
    return settings.detector.removeprefix(BESIDE) == VlmDetector.name
