"""Follows one thing from frame to frame: what it offers decides how, and unsure means lost."""

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ...geometry.outline import Outline
from .contour_fit import ContourFit
from .flow_fit import FlowFit
from .view import Bytes, Points, View

Fit = FlowFit | ContourFit

ROUNDS, SETTLED = 4, 0.3
"""A motion is measured so often at most, or until the view is off by no more px."""
SURE = 0.7
"""Where less agrees, the other way of measuring is asked too."""
LOST, FOUND = 0.4, 0.6
"""Where less agrees, the thing is not seen; nor one that was lost, until so much does."""
VISIBLE = 0.5
"""A thing of which a smaller share lies in the picture is not seen."""
JUMP = 0.3
"""No part of a thing moves further between two frames, as a share of its size."""


@dataclass(frozen=True)
class Tracked:
    """Where a thing is, turned about the centre of its outline, then moved.

    Attributes:
        dx, dy: how far it has moved since the first frame, px.
        turn: radians, clockwise as seen in the picture.
        confidence: 0 to 1; see `lost`.
    """

    dx: float
    dy: float
    turn: float
    confidence: float

    @property
    def lost(self) -> bool:
        """Whether the thing is not seen; the rest is then where it was seen last."""
        return self.confidence < LOST


class ObjectTracker:
    """A thing in the frames of a camera that stands still, (H, W, 3) BGR each.

    Args:
        first: the frame in which the thing has its outline.
        outline: of the thing, px of the frame.

    Raises:
        InputError: the thing has neither texture nor a colour of its own.
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
        """Where the thing is in the next frame, (H, W, 3)."""
        motion, confidence = self._found(frame)
        if confidence < (FOUND if self._unseen else LOST):
            self._unseen, confidence = self._unseen + 1, 0.0
        else:
            self._speed = (motion - self._motion) / (1 + self._unseen)
            self._motion, self._unseen = motion, 0
        dx, dy, turn = self._motion.tolist()
        return Tracked(dx, dy, turn, confidence)

    def _found(self, frame: Bytes) -> tuple[Points, float]:
        """The motion that most speaks for, and how much."""
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
