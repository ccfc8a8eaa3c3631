"""The files a run leaves: plan, picture, animation and trace, each whole or not at all."""

import io
import time
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..agent.session import Run
from ..agent.store.folder import NAME
from ..tools.draw import draw_deployment, draw_look, draw_plan, save_gif
from ..tools.errors import InputError
from ..tools.formation.plan import Plan
from ..tools.scene import Scene
from ..tools.store import store, write_whole
from ..tools.world import Workspace

PICTURES = ("plan.png", "question.png", "found.png")
MAX_ANIMATED = 1_000
"""More robots than this are drawn but not animated."""


class Folder:
    """Where a run's files go; made at once so that an unusable place is found before the work."""

    def __init__(self, path: Path | None, *, resumed: bool = False) -> None:
        self.path = path or _fresh(Path("formup-runs"))
        self._drawn = {name for name in PICTURES if resumed and (self.path / name).exists()}
        try:
            self._made = not self.path.exists()
            self.path.mkdir(parents=True, exist_ok=True)
            probe = self.path / f".probe-{time.time_ns()}"
            probe.touch()
            probe.unlink()
        except (OSError, RecursionError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "no usable path"
            raise InputError(
                f"The output folder {self.path} cannot be written: {why}; give another with --out."
            ) from None

    @property
    def trace(self) -> Path:
        """Where the run is written down."""
        return self.path / NAME

    def draw(self, name: str, image: Any) -> str:
        """Write a picture and return its name."""
        buffer = io.BytesIO()
        image.save(buffer, "PNG")
        write_whole(self.path / name, buffer.getvalue())
        self._drawn.add(name)
        return name

    def drop_pictures_but(self, name: str | None) -> None:
        """Remove the pictures drawn earlier in this run, before a question was answered."""
        stale = {old for old in self._drawn if old != name}
        for old in stale:
            (self.path / old).unlink(missing_ok=True)
        self._drawn -= stale

    def __enter__(self) -> "Folder":
        return self

    def __exit__(self, *raised: object) -> None:
        """Leave no empty folder behind when nothing came of the run."""
        if self._made:
            with suppress(OSError):
                self.path.rmdir()
                self.path.parent.rmdir()


def write_files(folder: Folder, run: Run) -> dict[str, str | None]:
    """Write what there is; names relative to the folder, None for what there is not."""
    files: dict[str, str | None] = {
        "plan": None,
        "picture": None,
        "animation": None,
        "trace": NAME,
    }
    workspace, report = run.workspace, run.report
    plan = workspace.plans.get(report.plan_id or "")
    title = report.instruction
    if plan is not None:
        stored = store(workspace, plan_id=plan.id, instruction=title)
        write_whole(folder.path / "plan.json", stored.model_dump_json(indent=1).encode())
        files["plan"] = "plan.json"
        if animate(folder.path / "deploy.gif", workspace, plan, title):
            files["animation"] = "deploy.gif"
    if report.candidates:
        files["picture"] = folder.draw("question.png", _choices(run))
    elif plan is not None:
        files["picture"] = folder.draw("plan.png", draw_plan(workspace.scene, plan, title))
    elif workspace.scene.targets or workspace.doubted:
        scene = workspace.scene
        shown = scene.with_target(workspace.doubted) if workspace.doubted else scene
        files["picture"] = folder.draw("found.png", draw_look(shown))
    folder.drop_pictures_but(files["picture"])
    return files


def _choices(run: Run) -> Any:
    """The picture with what a question offers and nothing else."""
    workspace = run.workspace
    asked = [choice["id"] for choice in run.report.candidates or ()]
    targets = tuple(t for t in workspace.scene.targets if t.id in asked)
    named = {t.id for t in targets}
    candidates = [workspace.candidate(name) for name in asked if name not in named]
    return draw_look(Scene(workspace.scene.picture, targets), candidates=candidates)


def animate(path: Path, workspace: Workspace, plan: Plan, title: str) -> bool:
    """Write the deployment of a plan as a GIF; False when it was not deployed."""
    frames = workspace.frames.get(plan.id)
    if not frames or len(frames[0]) > MAX_ANIMATED:
        return False
    takes = np.asarray(workspace.arrivals[plan.id].robots) - 1
    by_place = [poses[takes] for poses in frames]  # numbered as in the plan
    save_gif(draw_deployment(workspace.scene, plan, by_place, title), path)
    return True


def _fresh(parent: Path) -> Path:
    """A folder named by the time that is not there yet."""
    stem = datetime.now().astimezone().strftime("%Y-%m-%dT%H-%M-%S")
    names = (stem if i == 0 else f"{stem}-{i + 1}" for i in range(1_000))
    return next(parent / name for name in names if not (parent / name).exists())
