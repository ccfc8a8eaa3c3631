"""The files that a run leaves: plan, picture, animation and trace, each written atomically."""

import io
import time
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from ..agent.report import suggested
from ..agent.session import Run
from ..agent.store.folder import NAME
from ..tools.builtin.motions import ways_ahead
from ..tools.builtin.tracks import moved_of, read_track
from ..tools.context import Context
from ..tools.draw import FILMS, draw_look, draw_plan, save_film
from ..tools.errors import InputError
from ..tools.formation.plan import Plan
from ..tools.store import plan_file, write_whole
from ..tools.world import PlanNode

CONTRACT = "contract.json"
PASSING = ("plan.png", "question.png", "found.png", CONTRACT)
"""Files that a later turn, or the answer to a question, may make obsolete."""
QUICK = 1
"""PNG compression level of pictures: a fourth of the time, for a fourth more bytes."""


class Folder:
    """The folder of a run's files; created at once, so that an unusable path shows before the work.

    Args:
        path: None for a new folder in formup-runs, named by the time.
        resumed: whether the run goes on from files in the folder, which may become obsolete.

    Raises:
        InputError: the folder cannot be written.
    """

    def __init__(self, path: Path | None, *, resumed: bool = False) -> None:
        self.path = path or _fresh(Path("formup-runs"))
        self._passing = {name for name in PASSING if resumed and (self.path / name).exists()}
        try:
            self._made = not self.path.exists()
            self.path.mkdir(parents=True, exist_ok=True)
            probe = self.path / f".probe-{time.time_ns()}"
            probe.touch()
            probe.unlink()
        except (OSError, RecursionError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "not a usable path"
            raise InputError(
                f"The output folder {self.path} cannot be written: {why}; give another with --out."
            ) from None

    @property
    def trace(self) -> Path:
        """The file that the run is recorded in."""
        return self.path / NAME

    def draw(self, name: str, image: Any) -> str:
        """Write a picture and return its name."""
        buffer = io.BytesIO()
        image.save(buffer, "PNG", compress_level=QUICK)
        return self.write(name, buffer.getvalue())

    def write(self, name: str, data: bytes) -> str:
        """Write a file and return its name."""
        write_whole(self.path / name, data)
        self._passing.add(name)
        return name

    def drop_but(self, *names: str | None) -> None:
        """Remove obsolete files, written earlier in this run, except those named."""
        stale = self._passing - set(names)
        for old in stale:
            (self.path / old).unlink(missing_ok=True)
        self._passing -= stale

    def __enter__(self) -> "Folder":
        return self

    def __exit__(self, *raised: object) -> None:
        """Remove the folder, if the run created it, and its parent, if they are empty."""
        if self._made:
            with suppress(OSError):
                self.path.rmdir()
                self.path.parent.rmdir()


def write_files(folder: Folder, run: Run, film: Path | None = None) -> dict[str, str | None]:
    """Write the files of a run; return their names in the folder, None for those there are not.

    Args:
        film: another file for the film of the last deployment, besides the one in the folder.

    Raises:
        StorageError: a file cannot be written.
    """
    files: dict[str, str | None] = {
        "plan": None,
        "picture": None,
        "animation": None,
        "trace": NAME,
    }
    picture, world, report = run.context.picture, run.world, run.report
    node = world.plans.get(report.plan_id or "")
    title = report.instruction
    standing = node is not None and _is_standing(folder, run, node)
    if node is not None:
        files["plan"] = "plan.json"
    if node is not None and not standing:
        data = plan_file(world, node.plan.id, title, picture)
        write_whole(folder.path / "plan.json", data)
        files |= write_films(folder.path, film, run.context, node.plan, title)
    if report.candidates:
        files["picture"] = folder.draw("question.png", draw_choices(run))
    elif standing:
        files["picture"] = "plan.png"
    elif node is not None:
        ways = ways_ahead(run.context, world, node.plan)
        drawn = draw_plan(picture, world, node.plan, title, ways=ways)
        files["picture"] = folder.draw("plan.png", drawn)
    elif world.targets or world.doubted:
        files["picture"] = folder.draw("found.png", draw_look(picture, world.with_doubted()))
    if (contract := suggested(run.outcome)) is not None:
        data = contract.model_dump_json(indent=1, exclude_defaults=True).encode()
        files["contract"] = folder.write(CONTRACT, data)
    folder.drop_but(files["picture"], files.get("contract"), "plan.png" if standing else None)
    return files


def write_turn(folder: Folder, turn: int, run: Run, before: Plan | None) -> dict[str, str | None]:
    """Write what a turn of a chat has changed, in files named by its number.

    Args:
        before: the plan to compare with; arrows show which robots move.

    Returns:
        Names as of `write_files`.

    Raises:
        StorageError: a file cannot be written.
    """
    files: dict[str, str | None] = dict.fromkeys(("plan", "picture", "animation", "trace"))
    picture, world, report = run.context.picture, run.world, run.report
    title, node = report.instruction, world.plans.get(report.plan_id or "")
    if report.candidates:
        files["picture"] = folder.draw(f"question-{turn}.png", draw_choices(run))
    elif world.doubted is not None:
        found = draw_look(picture, world.with_doubted())
        files["picture"] = folder.draw(f"found-{turn}.png", found)
    elif node is not None:
        ways = ways_ahead(run.context, world, node.plan)
        drawn = draw_plan(picture, world, node.plan, title, before, ways)
        data = plan_file(world, node.plan.id, title, picture)
        files["picture"] = folder.draw(f"plan-{turn}.png", drawn)
        files["plan"] = folder.write(f"plan-{turn}.json", data)
        film = f"deploy-{turn}.gif"
        moved = report.arrival is not None
        if moved and animate(folder.path / film, run.context, node.plan, title):
            files["animation"] = film
    return files


def _is_standing(folder: Folder, run: Run, node: PlanNode) -> bool:
    """Return whether a plan is of an earlier turn, not driven to in this one, and has its files."""
    there = all((folder.path / name).exists() for name in ("plan.json", "plan.png"))
    return there and node is run.began.plans.get(node.plan.id) and run.report.arrival is None


def draw_choices(run: Run) -> Any:
    """Return the picture with only a question's choices drawn on it."""
    asked = [choice["id"] for choice in run.report.candidates or ()]
    targets = tuple(t for t in run.world.targets if t.id in asked)
    named = {t.id for t in targets}
    candidates = [run.context.candidate(name) for name in asked if name not in named]
    shown = run.world.having(targets=targets)
    return draw_look(run.context.picture, shown, candidates=candidates)


def film_file(path: Path | None) -> Path | None:
    """Check, before robots move, that a film can be written to a path, and return the path.

    Raises:
        InputError: its folder does not exist, or its suffix is not that of a film.
    """
    return _writable("--film", path, FILMS)


def trajectory_file(path: Path | None) -> Path | None:
    """Check and return the path of a file of trajectories, as `film_file` does."""
    return _writable("--trajectories", path, (".json", ".csv"))


def _writable(option: str, path: Path | None, endings: Sequence[str]) -> Path | None:
    if path is not None and (path.suffix.lower() not in endings or not path.parent.is_dir()):
        raise InputError(
            f"{option} {path} cannot be written; name a file ending in {', '.join(endings)} in an "
            "existing folder."
        )
    return path


def write_films(
    folder: Path, film: Path | None, context: Context, plan: Plan, title: str
) -> dict[str, str | None]:
    """Write the last deployment of a plan as an animation, and to `film` too if given.

    Returns:
        The names of the files written, `animation` in the folder and `film` as given.
    """
    files: dict[str, str | None] = {}
    if animate(folder / "deploy.gif", context, plan, title):
        files["animation"] = "deploy.gif"
        if film is not None and animate(film, context, plan, title):
            files["film"] = str(film)
    return files


def animate(path: Path, context: Context, plan: Plan, title: str) -> bool:
    """Write the last deployment of a plan as a film; return False if none was recorded."""
    arrival = context.world.arrivals.get(plan.id)
    if arrival is None or arrival.track is None:
        return False
    track = read_track(context.services.artefacts.get(arrival.track))
    place_of = {robot: place for place, robot in enumerate(track.ids)}
    order = [place_of[robot] for robot in plan.formation.robot_of_place]
    frames = [points[order] for points in track.points]
    moved = moved_of(context.world, arrival, track)
    save_film(path, context.picture, context.world, plan, frames, title, moved)
    return True


def _fresh(parent: Path) -> Path:
    """Return a path, named by the time, that does not exist yet."""
    stem = datetime.now().astimezone().strftime("%Y-%m-%dT%H-%M-%S")
    names = (stem if i == 0 else f"{stem}-{i + 1}" for i in range(1_000))
    return next(parent / name for name in names if not (parent / name).exists())
