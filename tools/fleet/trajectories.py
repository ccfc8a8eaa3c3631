"""A motion as data for other programs: waypoints, timed poses, velocities of a tracking controller.

The simulator's controller drives robots with two wheels, of which nothing goes wrong, in the
motion's order of passage; what it tells them is what leaves. Frame: image pixels.
"""

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import FleetError
from ..geometry.outline import FloatArray
from ..geometry.sampling import min_spacing
from ..motion.checking import MotionVerdict
from ..motion.following import Following
from ..motion.motion import Motion
from .physics import Physics
from .simulator import PERIOD, Simulator

DECIMALS = 6
FRAME = "x right, y down, 0, 0 is the centre of the picture's top left pixel; headings clockwise"
COLUMNS = (
    *("robot", "t_s", "x_px", "y_px", "heading_rad", "speed_px_s", "turn_rad_s"),
    *("along_px", "waits_for"),
)
LATE, WAITS_S = 20.0, 60.0
"""Robots that are not there after so many times the planned seconds and so many more never are."""


@dataclass(frozen=True)
class Trajectories:
    """How a controller tracks a motion.

    Attributes:
        error: how far robots that do as they are told may come off their paths, px.
        poses: (k, n, 3) x, y px and heading, radians, at k moments, `PERIOD` seconds apart.
        commands: (k, n, 2) speeds from each of them on, px/s, and turn rates, rad/s.
        along: (k, n) how far along its path each robot is, px, which passages are counted in.
    """

    motion: Motion
    verdict: MotionVerdict
    error: float
    poses: FloatArray
    commands: FloatArray
    along: FloatArray

    @property
    def ids(self) -> tuple[str, ...]:
        """Of the robots."""
        return tuple(self.motion.paths)

    def data(self, scale: float | None) -> dict[str, Any]:
        """All of it as JSON, in metres too where a picture has a scale, in metres per pixel."""
        rows, ids = self.motion.passages, self.ids
        columns = rows.waiting, rows.at, rows.first, rows.past
        order = zip(*(column.tolist() for column in columns), strict=True)
        return {
            "frame": FRAME,
            "metres_per_pixel": scale,
            "period_s": PERIOD,
            "error_px": round(self.error, DECIMALS),
            "motion": self.verdict.model_dump(mode="json"),
            "passages": [
                {"robot": ids[i], "at_px": at, "first": ids[j], "past_px": past}
                for i, at, j, past in order
            ],
            "robots": {robot: self._robot(k, scale) for k, robot in enumerate(ids)},
        }

    def _robot(self, k: int, scale: float | None) -> dict[str, Any]:
        robot = self.ids[k]
        path, times = self.motion.paths[robot], self.motion.times[robot]
        moments = PERIOD * np.arange(len(self.poses))
        pose, told = self.poses[:, k], self.commands[:, k]
        data = {
            "waypoints_px": np.column_stack([times, path]),
            "poses_px": np.column_stack([moments, pose]),
            "velocities_px": np.column_stack([moments, told]),
            "along_px": self.along[:, k],
        }
        if scale is not None:
            data["waypoints_m"] = data["waypoints_px"] * [1, scale, scale]
            data["poses_m"] = data["poses_px"] * [1, scale, scale, 1]
            data["velocities_m"] = data["velocities_px"] * [1, scale, 1]
        return {name: np.round(rows, DECIMALS).tolist() for name, rows in data.items()}

    def table(self, scale: float | None) -> str:
        """All of it but waypoints as CSV: a row for each robot and moment, robot by robot.

        `waits_for` names who has to have come how far along its path, in px, before the robot
        may be told to go on from there: "2@35.1 5@80".
        """
        out, rows = io.StringIO(), self.motion.passages
        metric = ("x_m", "y_m", "speed_m_s") if scale else ()
        write = csv.writer(out, lineterminator="\n").writerow
        write([*COLUMNS, *metric])
        for k, robot in enumerate(self.ids):
            mine = np.flatnonzero(rows.waiting == k)
            moment = np.searchsorted(self.along[:, k], rows.at[mine], side="right") - 1
            for step, (pose, told) in enumerate(
                zip(self.poses[:, k], self.commands[:, k], strict=True)
            ):
                held = mine[moment == step]
                waits = " ".join(f"{self.ids[rows.first[g]]}@{rows.past[g]:.6f}" for g in held)
                values = [PERIOD * step, *pose, *told, self.along[step, k]]
                more = [v * scale for v in (*pose[:2], told[0])] if scale else []
                write([robot, *_decimals(values), waits, *_decimals(more)])
        return out.getvalue()


def _decimals(values: list[float]) -> list[float]:
    return [round(float(v), DECIMALS) for v in values]


def tracked(
    motion: Motion,
    verdict: MotionVerdict,
    physics: Physics,
    looks: Mapping[str, float | None],
    error: float,
) -> Trajectories:
    """What a tracking controller tells robots with two wheels that drive a motion.

    Args:
        physics: of these robots, see `wheeled`.
        looks: where robots look first, radians, by id; the x axis where that is not known.
        error: how far they may be off their paths, px, as planned with.

    Raises:
        FleetError: they do not arrive, or come nearer to each other than is allowed.
    """
    ids, starts = tuple(motion.paths), np.array([path[0] for path in motion.paths.values()])
    headings = np.array([looks.get(robot) or 0.0 for robot in ids])
    sim, following = Simulator(ids, starts, headings, physics), Following(motion)
    poses, along = [np.column_stack([starts, headings])], [np.zeros(len(ids))]
    most = (LATE * motion.makespan + WAITS_S) / PERIOD
    sim.begin(motion)
    commands: list[FloatArray] = []
    while not sim.arrived:
        sim.step()
        poses.append(np.column_stack([sim.points, sim.headings]))
        along.append(following.advance(sim.points, along[-1]))
        turned = (sim.headings - poses[-2][:, 2]) / PERIOD
        commands.append(np.column_stack([np.hypot(*sim.velocities.T), turned]))
        if len(poses) > most:
            raise FleetError("Robots with two wheels would not arrive on that motion.")
    commands.append(np.zeros((len(ids), 2)))
    nearest = min(min_spacing(pose[:, :2]) for pose in poses)
    if nearest < verdict.demanded_px - 2 * error:
        raise FleetError(f"Robots with two wheels would come within {nearest:.2f} px.")
    return Trajectories(
        motion, verdict, error, np.array(poses), np.array(commands), np.array(along)
    )


def wheeled(speed: float, acceleration: float, radius: float) -> Physics:
    """Robots with two wheels, half the way between them a radius, of which nothing goes wrong."""
    return Physics(drive="differential", speed=speed, acceleration=acceleration, radius=radius)
