"""The first message of a turn: what the person asks for, as lines that a model can read."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any, cast

from ..tools.builtin.standing import arrival_facts
from ..tools.context import Context
from ..tools.draw import draw_view, view_scale
from ..tools.errors import InputError, ToolError
from ..tools.formation.contract import MAX_ROBOTS, Group
from ..tools.perception.image import Picture
from ..tools.perception.target_prompt import TargetPrompt
from ..tools.world import Target, World, to_json_values
from .messages import History, User

MOST_NUMBERED = 40
"""Most candidates that are numbered in the first picture."""


MOST_PAST = 12
"""Most earlier plans, which undo can go back to, in a turn's first message."""
MAX_TEXT = 4_000
"""Most characters of what a person says; longer texts are no instruction, and costly to read."""


@dataclass(frozen=True)
class Task:
    """The facts of a turn's first message.

    Attributes:
        robots: how many, or None if the person fixed no number beside the instruction.
        pointed: what the person pointed at, as arguments of propose_formation's `targets`.
        targets: ids of targets that were measured before the conversation began.
        deploy: whether robots are to move once the plan is certified.
        metres_per_pixel: scale of the picture; None if it has none.
        standing: in a later turn, the current plan and what led to it; see `standing`.
        robot_radius: px; None if nothing says how large the robots are.
        size: width and height of the picture, px.
        nouns: whether things can be found by nouns.
    """

    instruction: str
    robots: int | None
    pointed: tuple[dict[str, Any], ...]
    targets: tuple[str, ...]
    deploy: bool
    metres_per_pixel: float | None = None
    standing: dict[str, Any] | None = None
    robot_radius: float | None = None
    size: tuple[int, int] = (0, 0)
    nouns: bool = False


def first_message(context: Context, before: History, *, seen: bool, fresh: bool = False) -> User:
    """Return what is asked, with the picture for a model that sees and was not shown it yet.

    Args:
        context: with the person's words and the picture.
        before: the conversation so far, in which the picture has been shown.
        seen: whether the model sees.
        fresh: whether the picture is a new one.
    """
    if not seen or (before and not fresh):
        return User(text=task_text(context, follows=bool(before)))
    numbered = context.candidates()[:MOST_NUMBERED] if context.settings.numbered else ()
    image = draw_view(context.picture, context.world, candidates=numbered)
    scale = view_scale(context.picture)
    how = "" if scale == 1 else f", shown at {scale:.3g} times its size: read the rulers"
    how += ", numbers are candidates: 3 is c3" if numbered else ""
    return User(text=task_text(context, how, follows=bool(before)), images=(image,))


def task_text(context: Context, how: str = "", *, follows: bool = False) -> str:
    """Return a turn's first message: one fact per line, the person's words quoted to fit on one."""
    settings, world = context.settings, context.world
    picture, scale = world.picture, world.metres_per_pixel
    pointed = [p.brief for p in world.pointed]
    lines = {
        "Instruction": context.words,
        "Robots": settings.robots,
        "Picture": f"{picture.width} x {picture.height} px{how}",
        **({} if scale is None else {"Metres per pixel": scale}),
        **({"Robot radius": radius} if (radius := settings.robot_radius) else {}),
        "Pointed at": pointed,
        "Targets": [] if follows else [t.id for t in world.targets],
        "Deploy": settings.may_deploy,
        **({"Nouns are found": True} if context.finder else {}),
        **({"Standing": standing(context)} if follows else {}),
    }
    return "\n".join(f"{name}: {json.dumps(v, ensure_ascii=False)}" for name, v in lines.items())


def standing(context: Context) -> dict[str, Any] | None:
    """Return the current plan in short, all that a follow-up can refer to, or None without one.

    `last` is what made it: the person's words and, if it was a change, the edits; `undo` and `redo`
    are how many steps there are back and forward.
    """
    world = context.world
    node = world.plans.get(world.current or "")
    if node is None or world.is_void(node.plan):
        return None
    formation = node.plan.formation
    back = len(context.steps) - 1 - world.undone
    groups = zip(formation.contract.groups, formation.members, strict=False)
    apart = [formation.robots[i] for g, own in groups if g.relation == "at" for i in own]
    return {
        "plan": node.plan.id,
        "contract": _rounded(to_json_values(formation.contract)),
        "robots": formation.robots,
        **({"apart": apart} if 0 < len(apart) < len(formation.robots) else {}),
        "deployed": arrival_facts(world, node.plan)["arrived"],
        "last": {"words": node.words, "edits": json.loads(node.edit or "null")},
        "things": [
            {"id": t.id, "label": t.label, "centre": [round(v) for v in t.outline.centre]}
            for t in world.targets
        ],
        "past": _past(context, back),
        "undo": max(back, 0),
        "redo": world.undone,
    }


def _past(context: Context, back: int) -> list[tuple[list[str], int]]:
    """Return arrangements and number of robots of the plans undo goes back to, latest first."""
    steps = context.steps[max(back - MOST_PAST, 0) : max(back, 0)]
    names = [step.current for step in reversed(steps)]
    contracts = [context.world.plans[n].plan.formation.contract for n in names if n]
    return [([_form(g) for g in c.groups], sum(g.robots for g in c.groups)) for c in contracts]


def _form(group: Group) -> str:
    """Return a group's arrangement; a drawn circle counts as `around` its thing."""
    circle = group.shape is not None and group.shape.kind == "circle"
    return "around" if circle else group.relation


def _rounded(value: Any) -> Any:
    """Return a JSON value with numbers rounded to what a model needs."""
    if isinstance(value, float):
        return round(value, 1) if abs(value) >= 1 else round(value, 4)
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in cast("dict[str, Any]", value).items()}
    return (
        [_rounded(item) for item in cast("list[Any]", value)] if isinstance(value, list) else value
    )


def read_task(text: str) -> Task:
    """Return the facts of a message written by `task_text`.

    Raises:
        ValueError: `task_text` did not write it.
    """
    facts = {
        name: json.loads(value)
        for name, separator, value in (line.partition(": ") for line in text.split("\n"))
        if separator
    }
    return Task(
        instruction=facts["Instruction"],
        robots=facts["Robots"],
        pointed=tuple(facts["Pointed at"]),
        targets=tuple(facts["Targets"]),
        deploy=facts["Deploy"],
        metres_per_pixel=facts.get("Metres per pixel"),
        standing=facts.get("Standing"),
        robot_radius=facts.get("Robot radius") or _radius_of(facts.get("Standing")),
        size=_size(facts["Picture"]),
        nouns=facts.get("Nouns are found", False),
    )


def _radius_of(standing: dict[str, Any] | None) -> float | None:
    return standing["contract"].get("robot_radius") if standing else None


def _size(words: str) -> tuple[int, int]:
    width, _, height = words.split(" ")[:3]
    return int(width), int(height)


MOVED_SHARE = 0.1
"""How far a thing may have moved in another picture to be found: a share of its longer side."""


def in_new_picture(context: Context, picture: Picture) -> Context:
    """Return the context with another picture, in which targets are pointed at where they were."""
    context.services.pictures[picture.sha256] = picture
    world = World.of(picture)
    made = context.world.having(
        picture=world.picture,
        pointed=tuple(_where_it_was(t, world.picture.size) for t in context.world.targets),
        targets=(),
        keep_out=(),
        samples={},
        shown=(),
        phrases=(),
    )
    if context.settings.metres_per_pixel is None and world.metres_per_pixel is not None:
        made = made.having(metres_per_pixel=world.metres_per_pixel)
    return context.at(made)


def _where_it_was(target: Target, size: tuple[int, int]) -> TargetPrompt:
    """Return a prompt with a box around a target, widened by what it may have moved."""
    x0, y0, x1, y1 = target.box
    more = MOVED_SHARE * max(x1 - x0, y1 - y0)
    last = size[0] - 1, size[1] - 1
    box = (max(x0 - more, 0), max(y0 - more, 0), min(x1 + more, last[0]), min(y1 + more, last[1]))
    return TargetPrompt(id=target.id, label=target.label, box=box)


def pointed_at(pointed: Sequence[TargetPrompt], world: World) -> list[TargetPrompt]:
    """Return what is pointed at in a later turn, with ids other than those of existing targets.

    What was pointed at before and is not measured yet is still meant.
    """
    used = {target.id for target in world.targets}
    numbered = [prompt for prompt in world.pointed if prompt.id not in used]
    used.update(prompt.id for prompt in numbered)
    for prompt in pointed:
        name = prompt.id
        if name in used:
            name = next(f"t{i}" for i in count(1) if f"t{i}" not in used)
        used.add(name)
        numbered.append(prompt.model_copy(update={"id": name}))
    return numbered


def check_turn(context: Context, words: str, pointed: Sequence[TargetPrompt]) -> None:
    """Refuse what cannot be carried out, before anything is recorded.

    Raises:
        InputError: no words, an impossible number of robots, or a thing that is not there.
    """
    check_text("instruction", words, 'say what to do, such as "Surround the car at the corners"')
    robots = context.settings.robots
    if robots is not None and not 1 <= robots <= MAX_ROBOTS:
        raise InputError(f"{robots} robots cannot be placed; 1 to {MAX_ROBOTS:,} can.")
    problems = [p for q in pointed for p in q.problems(*context.world.picture.size)]
    if problems:
        raise InputError(" ".join(problems))
    try:
        for prompt in pointed:
            if prompt.candidate is not None:
                context.candidate(prompt.candidate)
    except ToolError as error:
        raise InputError(str(error)) from None


def check_text(name: str, text: str, advice: str) -> None:
    """Refuse a person's text that nobody could read.

    Raises:
        InputError: the text is empty, not UTF-8, or far too long.
    """
    if not text.strip():
        raise InputError(f"The {name} is empty; {advice}.")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(f"The {name} holds bytes that are not text in UTF-8.") from None
    if len(text) > MAX_TEXT:
        raise InputError(f"The {name} has {len(text):,} characters; {MAX_TEXT:,} can be read.")
