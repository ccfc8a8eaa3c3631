"""The frames of models that write coordinates alone, or why such a model cannot be tabled."""

from dataclasses import replace
from pathlib import Path

from ...tools.errors import InputError
from ..experiments.coordinate_frame import MOST, calibrate
from ..experiments.recordings import recordings
from .definition import Entry


def in_own_frame(entry: Entry, folder: Path) -> Entry:
    """Return the entry with the frame of its model, which is asked for five marks once in a run.

    If no known frame fits, the entry loses its method and its row says why (`missing`).

    Args:
        entry: of any method; only models that write coordinates alone are calibrated.
        folder: of the run.
    """
    arm = entry.arm
    if arm is None or arm.name != "alone" or recordings(arm.model):
        return entry
    try:
        made = calibrate(arm.agent(0), arm.model, folder)
    except InputError as error:
        why = f"not comparable: {error}"
        return replace(entry, row=entry.row.model_copy(update={"missing": why}), arm=None)
    if made.comparable:
        return replace(entry, arm=replace(arm, frame=made.frame))
    off = (
        f"marks are off by {100 * made.error:.1f} %, over {100 * MOST:.0f} %, in every frame known"
    )
    row = entry.row.model_copy(update={"missing": f"{arm.model} is not comparable: {off}"})
    return replace(entry, row=row, arm=None)
