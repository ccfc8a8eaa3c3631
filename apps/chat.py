"""`formup chat`: talk to a team of robots about a picture, or have a script do the talking."""

import asyncio
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from typer.core import TyperCommand

from ..agent.agent import Agent
from ..agent.service import Service
from ..agent.store.places import data_folder, store_at
from ..tools.context import Context, Settings
from ..tools.errors import InputError
from ..tools.perception.image import Picture
from ..tools.store import read_text
from . import arguments
from . import options as o
from .agents import agent_of
from .arguments import Things
from .chat_display import Display
from .chat_keyboard import ask_plainly, lines_piped
from .chat_lines import Talk
from .chat_terminal import converse, run_script
from .given import picture_given, settings_given
from .run_display import at_terminal
from .run_files import Folder
from .terminal import say
from .terminal_picture import way_of_terminal
from .window import watching

POINTING = ("--point", "--box", "--outline", "--target", "--mask")
"""Options that point at things, in the order in which `chat` reads them."""


class InOrder(TyperCommand):
    """A command that stores its raw arguments, so that things are t1, t2, ... in their order."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Store the arguments, then parse them as usual."""
        ctx.meta["words"] = list(args)
        return super().parse_args(ctx, args)


def chat(
    ctx: typer.Context,
    image: o.ChatImage = None,
    robots: o.Robots = None,
    point: o.Points = None,
    box: o.Boxes = None,
    outline: o.Outlines = None,
    target: o.Candidates = None,
    mask: o.Masks = None,
    keep_out: o.KeepOuts = None,
    script: o.Script = None,
    session: o.SessionId = None,
    store: o.StoreUrl = None,
    auto: o.Auto = False,
    plan_only: o.PlanOnly = False,
    plain: o.Plain = False,
    as_json: o.ScriptJson = False,
    out: o.Out = None,
    watch: o.Watch = False,
    model: o.ModelName = "offline",
    base_url: o.BaseUrl = None,
    planner: o.PlannerName = None,
    prompt: o.PromptName = None,
    prompts: o.PromptsFolder = None,
    numbered: o.Numbered = False,
    limit: o.LimitList = None,
    policy: o.PolicyList = None,
    detector: o.DetectorName = "standout",
    segmenter: o.SegmenterName = "grabcut",
    threshold: o.Threshold = None,
    descriptor: o.DescriptorName = "edges",
    fleet: o.FleetName = "simulated",
    starts: o.Starts = None,
    metres_per_pixel: o.MetresPerPixel = None,
    camera: o.Camera = None,
    calibration: o.CalibrationFile = None,
    robot_radius: o.Radius = None,
    clearance: o.Clearance = None,
    seed: o.Seed = "0",
) -> None:
    """Chat with the team: instruct, change, ask, undo; see /help."""
    picture = picture_given(ctx.params)
    settings = settings_given(ctx.params, picture)
    things = _in_order(ctx, arguments.shown((point, box, outline, target), mask, picture))
    begin = Beginning(picture, session, things, arguments.keep_out_things(keep_out), settings)
    rules, (lines, display) = _rules(policy, auto, plan_only), _front(script, as_json, plain)
    chosen = partial(_agent, (planner, base_url, prompt, prompts, limit, rules), display, lines)
    with chosen(model) as agent, Folder(out) as home, watching(watch, stays=False) as services:
        talk = Talk(Service(agent, store_at(store), auto=auto), home, chosen, services.view)
        raise typer.Exit(asyncio.run(_serve(talk, begin, lines, display, plain=plain)))


def _agent(
    rest: Any, display: Display | None, lines: Iterator[str] | None, model: str
) -> AbstractContextManager[Agent]:
    """Return the agent with a model; its replies are shown as they stream to a person who types."""
    told = display.fragment if display is not None and lines is None else None
    return agent_of(model, *rest, talks=True, show_text=told)


@dataclass(frozen=True)
class Beginning:
    """What a chat begins with: a picture and things pointed at in it, or a stored session."""

    picture: Picture | None
    session: str | None
    pointed: Things
    keep_out: Things
    settings: Settings

    def open(self, service: Service) -> str:
        """Open a new session or reopen the stored one, and return its id.

        Raises:
            InputError: there is neither a picture nor a session, or it cannot be used.
        """
        picture = self.picture
        if self.session is not None:
            service.reopen(self.session, picture)
            service.point(self.session, *self.pointed)
            return self.session
        if picture is None:
            raise InputError(
                "Give a picture to talk about, or a session to continue with --session ID."
            )
        Context.of(picture, self.settings)  # raises before anything is stored
        return service.open(
            picture, settings=self.settings, pointed=self.pointed, keep_out=self.keep_out
        )


async def _serve(
    talk: Talk,
    begin: Beginning,
    lines: Iterator[str] | None,
    display: Display | None,
    *,
    plain: bool,
) -> int:
    """Open the session, hold the chat, and return the exit code."""
    service = talk.service
    talk.session = begin.open(service)
    try:
        if lines is not None or display is None:
            return await run_script(talk, lines or (), display)
        if plain:
            ask = ask_plainly
        else:
            from .chat_prompt import Prompt  # its library takes a while to load

            ask = Prompt(data_folder() / "history", talk.words).ask
        who = service.session(talk.session).agent.model.name
        display.line("session", f"{talk.session}, model {who}; /help lists the commands")
        return await converse(talk, display, ask)
    finally:
        if service.session(talk.session).run is None:
            service.store.delete(talk.session)  # nothing was said in it
        else:
            say(f"formup: continue with formup chat --session {talk.session}", error=True)
        await service.close()


def _front(
    script: Path | None, as_json: bool, plain: bool
) -> tuple[Iterator[str] | None, Display | None]:
    """Return the lines of a script or program, None if a person types, and the chat's display.

    The display is None for JSON; it shows pictures unless the chat is plain or scripted.
    """
    lines = _lines(script, as_json)
    if as_json:
        return lines, None
    console = None if plain or lines is not None else Console(highlight=False)
    return lines, Display(console, "none" if console is None else way_of_terminal(console))


def _lines(script: Path | None, as_json: bool) -> Iterator[str] | None:
    """Return the lines of a script file or of stdin; None if a person types.

    Raises:
        InputError: the file cannot be read, or a person types and JSON is wanted.
    """
    if script is not None:
        return iter(read_text(script).splitlines())
    if not at_terminal():
        return lines_piped()
    if as_json:
        raise InputError("--json is for programs; give the turns with --script FILE or on stdin.")
    return None


def _rules(policy: list[str] | None, auto: bool, plan_only: bool) -> list[str]:
    """Return the policy's rules; with `plan_only`, the first one forbids moving robots.

    Raises:
        InputError: both `auto` and `plan_only` are set.
    """
    if auto and plan_only:
        raise InputError(
            "--auto moves robots at once and --plan-only never does; give only one of them."
        )
    return ["deploy=refuse"] * plan_only + (policy or [])


def _in_order(ctx: typer.Context, things: Sequence[Things]) -> Things:
    """Number things, given by kind of option, t1, t2, ... in the order of the command line."""
    words: list[str] = [word.partition("=")[0] for word in ctx.meta["words"]]
    kinds = [POINTING.index(word) for word in words if word in POINTING]
    places = sorted(range(len(kinds)), key=lambda i: kinds[i])
    given = sorted(zip(places, things, strict=True), key=lambda p: p[0])
    return arguments.numbered(group for _, group in given)
