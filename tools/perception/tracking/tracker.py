"""Tracks one thing from frame to frame, by texture or colours; if unsure, it counts as lost."""

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...geometry.outline import Outline
from .contour_fit import ContourFit
from .flow_fit import FlowFit
from .view import Bytes, Points, View

Fit = FlowFit | ContourFit

ROUNDS, SETTLED = 4, 0.3
"""The most rounds in which a motion is measured, and the px below which a step ends them."""
SURE = 0.7
"""Confidence below which the other way of measuring is tried too."""
LOST, FOUND = 0.4, 0.6
"""Confidence below which a thing is lost, and from which a lost one is found again."""
VISIBLE = 0.5
"""Least share of a thing in the picture for it to be seen."""
JUMP = 0.3
"""Greatest motion of any part of a thing between two frames, as a share of its size."""


@dataclass(frozen=True)
class Tracked:
    """Where a thing is: turned about the centre of its outline, then moved.

    Attributes:
        dx, dy: how far it has moved since the first frame, px.
        turn: how far it has turned, radians, clockwise as seen in the picture.
        confidence: 0 to 1; see `lost`.
    """

    dx: float
    dy: float
    turn: float
    confidence: float

    @property
    def lost(self) -> bool:
        """Whether the thing is not seen; its motion is then where it was last seen."""
        return self.confidence < LOST


class ObjectTracker:
    """Tracker of a thing in the frames of a fixed camera, (H, W, 3) BGR each.

    Args:
        first: the frame in which the thing has the outline.
        outline: the thing's outline, px of the frame.

    Raises:
        InputError: the thing has neither texture nor colours of its own.
    """

    def __init__(self, first: Bytes, outline: Outline) -> None:
        self._view, self._size = View(outline), outline.size
        self._motion, self._speed, self._unseen = np.zeros(3), np.zeros(3), 0
        seen = self._view.seen(first, self._motion)
        flow, contour = FlowFit(seen, self._view), ContourFit(seen, self._view)
        offered = {flow: flow.usable, contour: contour.usable}
        self._fits: list[Fit] = [fit for fit, usable in offered.items() if usable]
        if not self._fits:
            raise InputError(
                "The thing has no texture, nor colours that the ground around it has not: it "
                "cannot be followed by sight. Put something patterned on it, and measure it again."
            )

    def update(self, frame: Bytes) -> Tracked:
        """Find the thing in the next frame, (H, W, 3)."""
        motion, confidence = self._best_motion(frame)
        if confidence < (FOUND if self._unseen else LOST):
            self._unseen, confidence = self._unseen + 1, 0.0
        else:
            self._speed = (motion - self._motion) / (1 + self._unseen)
            self._motion, self._unseen = motion, 0
        dx, dy, turn = self._motion.tolist()
        return Tracked(dx, dy, turn, confidence)

    def _best_motion(self, frame: Bytes) -> tuple[Points, float]:
        """Return the motion that most agrees with the frame, and its confidence."""
        best, confidence = self._motion, 0.0
        frames = 1 + self._unseen
        for start in (self._motion + frames * self._speed, self._motion):
            for fit in self._fits:
                motion, share = self._measured(fit, frame, start)
                far = self._view.way(motion - self._motion)
                if share > confidence and far <= JUMP * self._size * frames:
                    best, confidence = motion, share
                    self._fits.sort(key=lambda other, now=fit: other is not now)
                if confidence >= SURE:
                    return best, confidence
        return best, confidence

    def _measured(self, fit: Fit, frame: Bytes, motion: Points) -> tuple[Points, float]:
        share = 0.0
        for _ in range(ROUNDS):
            within = self._view.within(fit.points, motion, frame)
            if within.mean() < VISIBLE:
                return motion, 0.0
            step = fit.step(self._view.seen(frame, motion), within)
            motion, share = self._view.moved(motion, step.by), step.share
            if self._view.way(step.by) < SETTLED:
                break
        return motion, share
