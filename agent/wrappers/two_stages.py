"""Two models as one: the first sees and says what is meant, the second plans without a picture.

This is the paper's method: a vision model gives the object of interest O and the pattern
instruction PI, another model makes the formation. The latter also changes the current plan, unseen
if it can. Whose turn it is follows from the history alone, which can be resumed and replayed.
"""

import json

from ...prompts import Prompt, PromptError, PromptLibrary
from ...tools.builtin import TOOLS
from ...tools.errors import InputError
from ...tools.tool import Tool
from ..first_message import read_task
from ..messages import History, Reply, Result, User, turn_of
from ..model import Model, Request

STANDARD = frozenset(tool.name for tool in TOOLS)


def offered(tools: tuple[Tool, ...], prompt: Prompt | None) -> tuple[Tool, ...]:
    """Return the tools that a prompt names, and those that are not built in."""
    if prompt is None or not prompt.tools:
        return tools
    chosen = [t for t in tools if t.name in prompt.tools or t.name not in STANDARD]
    names = {t.name for t in chosen}
    return tuple(t.beside(names) for t in chosen)


class TwoStages:
    """A model that looks, and one that plans once everything meant is measured.

    Args:
        looker: is given the picture.
        planner: is given what the person said, the pattern, and what was measured; no pictures.
        look: the looker's prompt.
        plan: the planner's prompt.
        repair: the planner's prompt after a proposal of its own that is not certified.
        revise: the planner's prompt when there is a current plan.
    """

    sees = True

    def __init__(
        self,
        looker: Model,
        planner: Model,
        *,
        look: Prompt,
        plan: Prompt,
        repair: Prompt,
        revise: Prompt,
    ) -> None:
        self.names = (looker.name, planner.name)
        self.name = "+".join(self.names)
        self._looker, self._planner = looker, planner
        self._look, self._plan, self._repair, self._revise = look, plan, repair, revise

    async def reply(self, request: Request) -> Reply:
        """Return the reply of the model whose turn it is.

        Raises:
            ModelError: that model cannot answer.
        """
        if request.aside:
            return await self._looker.reply(request)
        tools, turn = request.tools, tuple(turn_of(request.messages))
        found, stands = first_measuring_reply(turn), _plan_stands(turn)
        if found is None and (not stands or _is_to_look(turn)):
            seen = Request(self._look.render(), request.messages, offered(tools, self._look))
            return await self._looker.reply(seen)
        usual = self._revise if stands else self._plan
        prompt = self._repair if _uncertified(turn) else usual
        told = Request(prompt.render(), _planner_history(turn, found), offered(tools, prompt))
        return await self._planner.reply(told)

    async def aclose(self) -> None:
        """Close what either model keeps open."""
        for model in (self._looker, self._planner):
            close = getattr(model, "aclose", None)
            if close is not None:
                await close()


def prompt_named(library: PromptLibrary, name: str) -> Prompt:
    """Return the prompt of a name, which must not need values.

    Raises:
        InputError: there is none, or it needs values.
    """
    try:
        prompt = library.load(name)
        prompt.render()
    except PromptError as error:
        raise InputError(str(error)) from None
    return prompt


def staged(
    looker: Model, planner: Model, plan: str, library: PromptLibrary
) -> tuple[TwoStages, tuple[Prompt, ...]]:
    """Return two models as one, and their prompts.

    Raises:
        InputError: an unknown prompt, or a model that reads none.
    """
    blind = [m.name for m in (looker, planner) if not getattr(m, "prompt", None)]
    if blind:
        raise InputError(
            f"{blind[0]} reads no prompt and cannot share the work: "
            "model and planner are both language models, such as openai:NAME."
        )
    names = {"look": "context", "plan": plan, "repair": "repair", "revise": "revise"}
    prompts = {use: prompt_named(library, name) for use, name in names.items()}
    return TwoStages(looker, planner, **prompts), tuple(prompts.values())


def first_measuring_reply(messages: History) -> int | None:
    """Return the index of the first reply whose `segment` calls all succeeded, or None."""
    failed: dict[str, bool] = {}
    for message in messages:
        if isinstance(message, Result) and message.name == "segment":
            failed[message.call_id] = message.error is not None
    for place, message in enumerate(messages):
        if isinstance(message, Reply):
            asked = [c.id for c in message.calls if c.name == "segment"]
            if asked and not any(failed.get(id, True) for id in asked):
                return place
    return None


def _plan_stands(turn: History) -> bool:
    """Return whether there was a current plan when the turn began."""
    return read_task(turn[0].text).standing is not None


def _is_to_look(turn: History) -> bool:
    """Return whether the planner has asked for a look at the picture, which it cannot see."""
    return any(isinstance(m, Result) and m.name == "look" for m in turn)


def _uncertified(messages: History) -> bool:
    proposals = [m for m in messages if isinstance(m, Result) and m.name == "propose_formation"]
    last = proposals[-1] if proposals else None
    return last is not None and (last.error is not None or not json.loads(last.text)["certified"])


def _planner_history(messages: History, found: int | None) -> History:
    """Return the history with the looker's part replaced by its outcome in the person's message.

    A planner that read the pattern as its own words might go on as if it had seen the picture.
    """
    if found is None:
        return tuple(map(_without_pictures, messages))
    looked = messages[found]
    assert isinstance(looked, Reply)
    calls = {call.id for call in looked.calls}
    answers = [m for m in messages[found:] if isinstance(m, Result) and m.call_id in calls]
    facts = ", ".join(m.text for m in answers if m.name == "segment")
    said = [m.text for m in messages[:found] if isinstance(m, User)]
    pattern = json.dumps(looked.text, ensure_ascii=False)
    first = User(text="\n".join([*said, f"Pattern: {pattern}", f"Measured: [{facts}]"]))
    rest = messages[found + 1 + len(answers) :]
    return (first, *(_without_pictures(m) for m in rest))


def _without_pictures(message: User | Reply | Result) -> User | Reply | Result:
    shown = not isinstance(message, Reply) and message.images
    return message.model_copy(update={"images": ()}) if shown else message
