"""The slash commands of a chat: passed to the service, or answered from the current state."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..agent.report import Totals
from ..agent.session import Run, Show
from ..tools.builtin.standing import standing_data
from ..tools.draw.change import moves_between
from ..tools.errors import InputError
from ..tools.geometry.outline import FloatArray
from ..tools.perception.image import load_picture
from ..tools.store import plan_file, write_whole
from . import arguments
from .run_display import certificate_lines, group_words
from .sessions import export, list_words

if TYPE_CHECKING:
    from .chat_lines import Talk

NO_PLAN = "There is no plan yet; say what the robots should do."
Done = Run | str | None
"""The result of a command: the run it made, a text to show, or None to end the chat."""


@dataclass(frozen=True)
class Command:
    """A slash command.

    Attributes:
        takes: what may follow it, as the help shows it.
        draws: whether a picture goes with its text.
    """

    takes: str
    help: str
    do: Callable[["Talk", str, Show | None], Awaitable[Done]]
    draws: bool = False


def command_named(line: str) -> Command:
    """Return the command that a line begins with, in full or as an unambiguous prefix.

    Raises:
        InputError: no command matches, or several do.
    """
    name = line.split(maxsplit=1)[0][1:].lower()
    found = [name] if name in COMMANDS else [c for c in COMMANDS if name and c.startswith(name)]
    if len(found) == 1:
        return COMMANDS[found[0]]
    meant = found or COMMANDS
    raise InputError(
        f"There is no command {'/' + name!r}; use one of {', '.join('/' + c for c in meant)} "
        "(/help explains them)."
    )


async def _help(talk: "Talk", rest: str, show: Show | None) -> Done:
    lines = [f"{' '.join(f'/{n} {c.takes}'.split())}: {c.help}" for n, c in COMMANDS.items()]
    return "\n".join(["Say what the robots should do, or ask a question. Commands:", *lines])


async def _image(talk: "Talk", rest: str, show: Show | None) -> Done:
    if not rest:
        raise InputError("/image needs the file of a picture, such as /image photo.jpg.")
    return await talk.service.image(talk.session, load_picture(Path(rest)))


async def _robots(talk: "Talk", rest: str, show: Show | None) -> Done:
    context = talk.run.context.at(talk.run.world)
    if context.world.current is None:
        return NO_PLAN
    data = standing_data(context)
    lines = [_robot_words(row) for row in data["each"]]
    more = data["robots"] - len(lines)
    return "\n".join([*lines, *([f"and {more} more"] if more else [])])


def _robot_words(row: Mapping[str, Any]) -> str:
    words = [f"robot {row['robot']}: place {_point_words(row['place'])}"]
    if "at" in row:
        words.append(f"stands at {_point_words(row['at'])}")
    if "target_px" in row:
        words.append(f"{row['target_px']:g} px from {row['target']}")
    if "neighbour_px" in row:
        words.append(f"{row['neighbour_px']:g} px from robot {row['neighbour']}")
    return ", ".join(words)


def _point_words(point: Sequence[float]) -> str:
    return f"({point[0]:g}, {point[1]:g})"


async def _plan(talk: "Talk", rest: str, show: Show | None) -> Done:
    world, report = talk.run.world, talk.run.report
    node = world.plans.get(world.current or "")
    if node is None:
        return NO_PLAN
    plan, scale = node.plan, world.metres_per_pixel
    lines = [group_words(group, scale) for group in plan.formation.contract.groups]
    shown = report.model_copy(update={"plan_id": plan.id, "verdict": plan.verdict})
    lines += [f"{name}: {text}" for name, text in certificate_lines(shown)]
    lines += [f"made from {node.parent}"] if node.parent else []
    lines += ["The plan is void: its picture or target has changed since."] * world.is_void(plan)
    return "\n".join(lines)


async def _show_again(talk: "Talk", rest: str, show: Show | None) -> Done:
    return talk.run.world.current or NO_PLAN


async def _diff(talk: "Talk", rest: str, show: Show | None) -> Done:
    world = talk.run.world
    node = world.plans.get(world.current or "")
    parent = world.plans.get((node and node.parent) or "")
    if node is None or parent is None:
        return "The current plan was not made from another one." if node else NO_PLAN
    moves = moves_between(parent.plan, node.plan)
    lines = [f"{node.plan.id} was made from {parent.plan.id} by {node.edit or 'a new contract'}"]
    for robot, (old, new) in sorted(moves.moved.items(), key=lambda m: (len(m[0]), m[0])):
        by = f"{float(np.hypot(*(new - old))):.1f} px"
        lines.append(f"robot {robot} moves {by}, from {_at(old)} to {_at(new)}")
    lines += [f"robot {robot} joins at {_at(place)}" for robot, place in moves.joined.items()]
    lines += [f"robot {robot} leaves {_at(place)}" for robot, place in moves.left.items()]
    return "\n".join(lines)


def _at(point: FloatArray) -> str:
    return _point_words(point.round(1).tolist())


async def _undo(talk: "Talk", rest: str, show: Show | None) -> Done:
    return await talk.service.undo(talk.session, _how_many("/undo", rest))


async def _redo(talk: "Talk", rest: str, show: Show | None) -> Done:
    return await talk.service.undo(talk.session, -_how_many("/redo", rest))


def _how_many(name: str, rest: str) -> int:
    return arguments.whole(name, rest or "1", least=1, most=1000)


async def _approve(talk: "Talk", rest: str, show: Show | None) -> Done:
    waits = await talk.service.waits(talk.session)
    plan_id = rest or talk.run.report.plan_id or ""
    return await talk.service.approve(talk.session, plan_id, waits.nonce if waits else "", show)


async def _go(talk: "Talk", rest: str, show: Show | None) -> Done:
    return await talk.service.go(talk.session, rest or None, show)


async def _stop(talk: "Talk", rest: str, show: Show | None) -> Done:
    return await talk.service.stop(talk.session) or "Nothing has moved yet."


async def _save(talk: "Talk", rest: str, show: Show | None) -> Done:
    world = talk.run.world
    if world.current is None:
        return NO_PLAN
    path = Path(rest) if rest else talk.folder.path / "plan.json"
    title = talk.run.report.instruction
    write_whole(path, plan_file(world, world.current, title, talk.run.context.picture))
    return f"Plan {world.current} is saved in {path}; formup deploy {path} moves robots to it."


async def _sessions(talk: "Talk", rest: str, show: Show | None) -> Done:
    if rest:
        talk.service.reopen(rest)
        talk.session = rest
        return f"Switched to session {talk.session}."
    return f"This is session {talk.session}.\n{list_words(talk.service.store.sessions())}"


async def _who(talk: "Talk", rest: str, show: Show | None) -> Done:
    held = talk.service.session(talk.session)
    if rest:
        held.agent = talk.agents.enter_context(talk.agent_named(rest))
    return f"The model is {held.agent.model.name}."


async def _cost(talk: "Talk", rest: str, show: Show | None) -> Done:
    spent, begun = Totals(), talk.service.session(talk.session).run is not None
    for event in talk.service.events(talk.session) if begun else ():
        if event.kind == "end":
            used = Totals.model_validate(event.data["usage"])
            sums = {name: getattr(spent, name) + value for name, value in used}
            spent = Totals(**sums)
    return (
        f"{spent.requests} requests, {spent.tool_calls} tool calls, {spent.input_tokens:,} tokens "
        f"in and {spent.output_tokens:,} out, {spent.cost_usd:.4f} USD, {spent.seconds:.1f} s."
    )


async def _export(talk: "Talk", rest: str, show: Show | None) -> Done:
    if talk.service.session(talk.session).run is None:
        return "Nothing has been said in this session yet."
    folder = Path(rest) if rest else talk.folder.path / "session"
    return export(talk.service.store.open(talk.session), folder)


async def _point(talk: "Talk", rest: str, show: Show | None) -> Done:
    (thing,) = arguments.pointed([rest], None, None, None, option="/point")
    if talk.run.report.status == "question":
        return await talk.service.say(talk.session, "", pointed=[thing], show=show)
    number = len(talk.service.session(talk.session).pointed) + 1
    talk.service.point(talk.session, thing.model_copy(update={"id": f"t{number}"}))
    return "Noted; the point goes with your next message."


async def _quit(talk: "Talk", rest: str, show: Show | None) -> Done:
    return None


COMMANDS = {
    "help": Command("", "list the commands", _help),
    "image": Command(
        "FILE", "use another picture from here on; earlier plans stay readable", _image
    ),
    "robots": Command(
        "", "each robot's place, position, and distances to target and neighbour", _robots
    ),
    "plan": Command("", "the current plan: what it requires, and its certificate", _plan),
    "show": Command("", "show the plan's picture again", _show_again, draws=True),
    "diff": Command(
        "", "show which robots the last change moved, with a picture", _diff, draws=True
    ),
    "undo": Command("[N]", "go back one step, or N; robots stay where they are", _undo),
    "redo": Command("[N]", "go forward again one step, or N", _redo),
    "approve": Command("[PLAN]", "approve moving real robots to exactly this plan", _approve),
    "go": Command("[PLAN]", "move the robots to the current plan, or to PLAN", _go),
    "stop": Command("", "hold all robots where they are, at once; so does Ctrl-C", _stop),
    "save": Command("[FILE]", "save the plan to a file, for formup deploy", _save),
    "sessions": Command("[ID]", "list the sessions, or switch to session ID", _sessions),
    "model": Command(
        "[PROVIDER:NAME]", "show the model that decides, or use another from here on", _who
    ),
    "cost": Command("", "show the requests, tokens and US dollars this session has used", _cost),
    "export": Command("[FOLDER]", "export this session to a folder", _export),
    "point": Command("X,Y", "point at a target, in pixels; also answers a question", _point),
    "quit": Command("", "leave the chat; the session is kept", _quit),
}
