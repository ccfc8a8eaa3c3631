"""The agent that command-line options choose; its spans go where the environment says."""

from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ..agent.agent import Agent
from ..agent.model import Model, ShowText
from ..agent.wrappers.telemetry import environment_tracer
from ..prompts import PromptLibrary
from ..tools.errors import InputError
from . import arguments
from .terminal import say

if TYPE_CHECKING:
    from opentelemetry.trace import Tracer


CONVERSE = "converse"


@contextmanager
def agent_of(
    model: str | Model,
    planner: str | None,
    base_url: str | None,
    prompt: str | None,
    prompts: Path | None,
    limit: list[str] | None,
    policies: list[str] | None,
    *,
    talks: bool = False,
    show_text: ShowText | None = None,
) -> Generator[Agent, None, None]:
    """Yield the agent that the options choose; the offline planner gets no prompt.

    Args:
        talks: whether a language model gets the prompt for conversations by default.
        show_text: see `Agent`.
    """
    if talks and prompt is None and planner is None and model != "offline":
        prompt = CONVERSE
    limits, policy = arguments.limits(limit), arguments.policy(policies)
    with tracer_of_environment() as tracer:
        agent = Agent(
            model,
            base_url=base_url,
            planner=planner,
            prompt=prompt,
            library=PromptLibrary(prompts),
            limits=limits,
            policy=policy,
            tracer=tracer,
            show_text=show_text,
        )
        if agent.model.name == "offline" and agent.prompt is not None:
            say(
                "formup: the offline planner follows rules, not a prompt; "
                f"{agent.prompt.name} is not used.",
                error=True,
            )
            agent = Agent(model, limits=limits, policy=policy, tracer=tracer)
        yield agent


@contextmanager
def tracer_of_environment() -> "Generator[Tracer | None, None, None]":
    """Yield the tracer that the environment asks for, if any; if it fails, say so, yield None."""
    with ExitStack() as stack:
        tracer = None
        try:
            tracer = stack.enter_context(environment_tracer())
        except InputError as error:
            say(f"formup: no spans are sent: {error}", error=True)
        yield tracer
