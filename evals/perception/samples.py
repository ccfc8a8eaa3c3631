"""Samples: things of suites that are pointed at, measured and compared with the truth."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal, get_args

import shapely

from ...tools.errors import InputError
from ...tools.perception.contours import outline_of_mask
from ...tools.perception.image import Picture, load_picture
from ...tools.perception.segmenters.grabcut import Bytes, box_region, grabcut, trimap, window_around
from ...tools.perception.segmenters.protocol import Segmenter
from ...tools.perception.target_prompt import TargetPrompt
from ..experiments.pointing import can_point, pointing
from ..grading.boundaries import boundary_error
from ..tasks.suites import load_suite
from ..tasks.task import Task

Mode = Literal["outline", "box", "point"]
MODES: tuple[Mode, ...] = get_args(Mode)
TRIALS = 3
"""How often each thing is pointed at, with another jitter each time."""


@dataclass(frozen=True)
class Sample:
    """One thing pointed at once, and what was measured.

    Attributes:
        suite, picture, thing: names of what it was.
        overlap: intersection over union with the true region; 0 if there is no outline.
        boundary_error: distance within which 95 % of either boundary lie of the other one, as a
            share of the square root of the true area (the larger of the two directions).
        confidence: the segmenter's; `threshold` is the least at which a mask is used.
        cues: what the confidence is computed from.
        seconds: of CPU time; `bare_seconds` are those of one GrabCut on the same window.
    """

    suite: str
    picture: str
    thing: str
    overlap: float
    boundary_error: float
    confidence: float
    threshold: float
    cues: Mapping[str, float]
    seconds: float
    bare_seconds: float

    @property
    def placed(self) -> bool:
        """Whether robots would be placed about it."""
        return self.confidence >= self.threshold


def measured(suite: str, mode: Mode, segmenter: Segmenter) -> Iterator[Sample]:
    """Yield samples of every thing that tasks of a suite are about, pointed at `TRIALS` times.

    Raises:
        InputError: no such suite, or no task of it has one thing on a picture file to point at.
    """
    seen: set[tuple[Path, str]] = set()
    for task in load_suite(suite).tasks:
        if not isinstance(task.picture, Path) or not can_point(task, mode):
            continue
        key = task.picture, task.things[0].id
        if key not in seen:
            seen.add(key)
            for number in range(TRIALS):
                (prompt,) = pointing(task, mode, number).pointed
                yield _sample(suite, task, task.picture, prompt, segmenter)
    if not seen:
        raise InputError(f"No task of the suite {suite} has one thing on a picture to point at.")


def peak_memory() -> float:
    """Return the most memory this process has held, MiB."""
    import resource  # does not exist on Windows

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _sample(
    suite: str, task: Task, path: Path, prompt: TargetPrompt, segmenter: Segmenter
) -> Sample:
    picture, thing = _loaded(path), task.things[0]
    began = time.process_time()
    found = segmenter.segment(picture.pixels, prompt)
    seconds = time.process_time() - began
    truth = shapely.make_valid(thing.region)
    overlap, error = 0.0, 1.0
    try:
        outline = outline_of_mask(found.mask).polygon
    except InputError:  # nothing was found
        pass
    else:
        overlap, error = thing.overlap(outline), boundary_error(outline, truth)
    return Sample(
        suite=suite,
        picture=path.stem,
        thing=thing.id,
        overlap=overlap,
        boundary_error=error,
        confidence=found.confidence,
        threshold=segmenter.thresholds[prompt.how],
        cues=found.parts,
        seconds=seconds,
        bare_seconds=_bare_seconds(picture.pixels, truth.bounds),
    )


@lru_cache(maxsize=1)
def _loaded(path: Path) -> Picture:
    return load_picture(path)


def _bare_seconds(pixels: Bytes, box: Sequence[float]) -> float:
    """Return the CPU time of one GrabCut in a box, the simplest segmentation to be had, s."""
    x0, y0, x1, y1 = box
    window = window_around(pixels, (x0, y0, x1, y1))
    inside = box_region(window.shape, window.to_work(((x0, y0), (x1, y1))).ravel())
    labels = trimap(inside, inside)
    began = time.process_time()
    grabcut(window.features, labels)
    return time.process_time() - began
