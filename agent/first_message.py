"""What the person asks for, as the first message of a conversation: lines a model can read."""

import json
from dataclasses import dataclass
from typing import Any

from ..tools.draw import draw_view, view_scale
from ..tools.world import Workspace
from .messages import User

MOST_NUMBERED = 40
"""Candidates in the first picture."""


@dataclass(frozen=True)
class Task:
    """The facts of the first message.

    Attributes:
        robots: how many, or None where the person left it to the words.
        pointed: what the person pointed at, as arguments of propose_formation's `targets`.
        targets: ids of targets that are measured already.
        deploy: whether robots shall move once the plan is certified.
        metres_per_pixel: of the picture; None where it has no scale.
    """

    instruction: str
    robots: int | None
    pointed: tuple[dict[str, Any], ...]
    targets: tuple[str, ...]
    deploy: bool
    metres_per_pixel: float | None = None


def first_message(workspace: Workspace, *, seen: bool) -> User:
    """What is asked, and for a model that sees the picture it is asked about.

    Args:
        workspace: with the person's words and the picture.
        seen: whether the model sees.
    """
    if not seen:
        return User(text=task_text(workspace))
    numbered = workspace.candidates()[:MOST_NUMBERED] if workspace.settings.numbered else ()
    image = draw_view(workspace.scene, candidates=numbered)
    scale = view_scale(workspace.scene.picture)
    how = "" if scale == 1 else f", shown at {scale:.3g} times its size: read the rulers"
    how += ", numbers are candidates: 3 is c3" if numbered else ""
    return User(text=task_text(workspace, how), images=(image,))


def task_text(workspace: Workspace, how: str = "") -> str:
    """The first message: one fact a line, the person's words quoted so that they stay one."""
    settings, scene = workspace.settings, workspace.scene
    picture, scale = scene.picture, scene.metres_per_pixel
    pointed = [
        p.model_dump(mode="json", exclude_defaults=True) | {"id": p.id} for p in workspace.pointed
    ]
    lines = {
        "Instruction": workspace.instruction,
        "Robots": settings.robots,
        "Picture": f"{picture.width} x {picture.height} px{how}",
        **({} if scale is None else {"Metres per pixel": scale}),
        "Pointed at": pointed,
        "Targets": [t.id for t in scene.targets],
        "Deploy": settings.may_deploy,
    }
    return "\n".join(f"{name}: {json.dumps(v, ensure_ascii=False)}" for name, v in lines.items())


def read_task(text: str) -> Task:
    """The facts of a message written by `task_text`.

    Raises:
        ValueError: it was not.
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
    )
