"""A workspace as JSON and back: the state file of single tool calls, and plan.json.

Pictures are not stored but named, with their hash; reading refuses one that has changed.
"""

import hashlib
import json
import secrets
from pathlib import Path
from typing import Any, cast

import numpy as np
from pydantic import Field, ValidationError
from pydantic_core import to_json

from .errors import ImageError, InputError
from .formation.plan import Plan
from .formation.value import Value
from .geometry.outline import make_outline
from .perception.image import Picture, load_picture
from .perception.target_prompt import Box, Point, TargetPrompt
from .scene import Scene, Target
from .tool import violations
from .world import Settings, Workspace

FORMAT = "formup/1"
MAX_BYTES = 64 << 20


class StoredTarget(Value):
    """A target with its outline as rings of points."""

    later = frozenset({"source"})
    id: str
    label: str
    box: Box
    confidence: float
    prompt: str
    parts: dict[str, float]
    missed: tuple[Point, ...] = ()
    outline: tuple[Point, ...]
    holes: tuple[tuple[Point, ...], ...]
    source: TargetPrompt | None = None


class StoredImage(Value):
    """Where the picture lies and what it must be, and its scale if that is known."""

    later = frozenset({"metres_per_pixel"})
    path: str | None
    sha256: str
    width: int
    height: int
    metres_per_pixel: float | None = None


class Stored(Value):
    """All of a workspace but its settings; `plan_id` names the plan a plan.json is for."""

    later = frozenset({"unseen"})
    format: str = FORMAT
    digest: str = ""
    plan_id: str | None = None
    instruction: str | None = None
    image: StoredImage
    targets: tuple[StoredTarget, ...] = ()
    pointed: tuple[TargetPrompt, ...] = ()
    samples: dict[str, tuple[Point, ...]] = Field(default_factory=dict)
    plans: dict[str, Plan] = Field(default_factory=dict)
    unseen: dict[str, tuple[str, ...]] = Field(default_factory=dict)

    def sealed(self) -> "Stored":
        """The same with the digest of its content, by which an alteration shows."""
        blank = self.model_copy(update={"digest": ""})
        digest = hashlib.sha256(to_json(blank)).hexdigest()
        return self.model_copy(update={"digest": digest})


def store(
    workspace: Workspace, *, plan_id: str | None = None, instruction: str | None = None
) -> Stored:
    """The workspace as a value; with a plan id only that plan is kept."""
    picture = workspace.scene.picture
    plans = workspace.plans if plan_id is None else {plan_id: workspace.plans[plan_id]}
    return Stored(
        plan_id=plan_id,
        instruction=instruction,
        image=StoredImage(
            path=None if picture.path is None else str(picture.path),
            sha256=picture.sha256,
            width=picture.width,
            height=picture.height,
            metres_per_pixel=workspace.scene.metres_per_pixel,
        ),
        targets=tuple(_stored_target(t) for t in workspace.scene.targets),
        pointed=workspace.pointed,
        samples={name: tuple(map(tuple, p.tolist())) for name, p in workspace.samples.items()}
        if plan_id is None
        else {},
        plans=plans,
        unseen={name: who for name, who in workspace.unseen.items() if name in plans},
    ).sealed()


def read_stored(path: Path) -> Stored:
    """Read a state file or a plan.json.

    Raises:
        InputError: missing, no JSON, of another format, or altered.
    """
    try:
        data: Any = json.loads(read_text(path))
    except (ValueError, RecursionError):
        raise InputError(f"{path} is not JSON; a file written by formup is needed.") from None
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise InputError(f"{path} is no formup file of format {FORMAT!r}.")
    return checked(cast(object, data), path)


def checked(data: object, path: Path) -> Stored:
    """What was stored, if it is as it was written.

    Args:
        path: of the file it comes from, for messages.

    Raises:
        InputError: damaged or altered.
    """
    try:
        stored = Stored.model_validate(data)
        sealed = stored.sealed()
    except ValidationError as error:
        raise InputError(f"{path} is damaged: {violations(error)}") from None
    except ValueError:
        raise InputError(f"{path} is damaged: it holds text that is not Unicode.") from None
    ids = [target.id for target in stored.targets]
    altered = [name for name, plan in stored.plans.items() if plan.id != name]
    if stored.digest != sealed.digest or altered or len(set(ids)) < len(ids):
        raise InputError(
            f"{path} was altered after formup wrote it, so its plans are not certified; "
            "make the plan again."
        )
    return stored


def read_text(path: Path) -> str:
    """The text of a file a person named.

    Raises:
        InputError: missing, no regular file, too large, not readable or not UTF-8.
    """
    try:
        if path.exists() and not path.is_file():
            raise InputError(f"{path} is no file that can be read.")
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path} has more than {MAX_BYTES >> 20} MiB.")
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}.") from None
    except UnicodeDecodeError:
        raise InputError(f"{path} is not JSON or text in UTF-8.") from None


def restore(stored: Stored, picture: Picture | None, settings: Settings) -> Workspace:
    """The workspace again, on `picture` or on what lies where its own lay.

    Raises:
        ImageError: the picture cannot be loaded.
        InputError: the picture has changed since.
    """
    if picture is None:
        if stored.image.path is None:
            raise ImageError("The stored scene names no picture file; give one.")
        picture = load_picture(stored.image.path)
    if picture.sha256 != stored.image.sha256:
        shown = picture.path or picture.name
        raise InputError(
            f"{shown} is not the picture this was made for, or it has changed since, which voids "
            "its targets and plans; run again on the new picture."
        )
    return Workspace(
        scene=Scene(
            picture, tuple(_target(t) for t in stored.targets), stored.image.metres_per_pixel
        ),
        settings=settings,
        pointed=stored.pointed,
        plans=dict(stored.plans),
        unseen=dict(stored.unseen),
        samples={name: np.asarray(p, dtype=float) for name, p in stored.samples.items()},
    )


def write_whole(path: Path, data: bytes) -> None:
    """Write a file at once or not at all, readable to whom the person's umask allows.

    What is no file, such as /dev/stdout, is written to and stays what it is; a link is followed.

    Raises:
        InputError: it cannot be written there.
    """
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            path.write_bytes(data)
            return
        path = path.resolve() if path.is_symlink() else path
        part = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
        try:
            with part.open("xb") as file:
                file.write(data)
            part.replace(path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}.") from None


def rings(target: Target) -> tuple[list[list[float]], list[list[list[float]]]]:
    """A target's exterior and holes as JSON, rounded to what they are known to."""
    polygon = target.outline.polygon
    shapes: list[Any] = [polygon.exterior, *polygon.interiors]
    points = [[[round(x, 3), round(y, 3)] for x, y in ring.coords[:-1]] for ring in shapes]
    return points[0], points[1:]


def _stored_target(target: Target) -> StoredTarget:
    polygon = target.outline.polygon
    return StoredTarget(
        id=target.id,
        label=target.label,
        box=target.box,
        confidence=target.confidence,
        prompt=target.prompt,
        parts=dict(target.parts),
        missed=target.missed,
        source=target.source,
        outline=tuple((float(x), float(y)) for x, y in polygon.exterior.coords[:-1]),
        holes=tuple(
            tuple((float(x), float(y)) for x, y in ring.coords[:-1]) for ring in polygon.interiors
        ),
    )


def _target(stored: StoredTarget) -> Target:
    return Target(
        id=stored.id,
        label=stored.label,
        box=stored.box,
        confidence=stored.confidence,
        outline=make_outline(stored.outline, stored.holes),
        prompt=stored.prompt,
        parts=tuple(stored.parts.items()),
        missed=stored.missed,
        source=stored.source,
    )
