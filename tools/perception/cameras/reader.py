"""A camera's newest frame and how old it is, whatever the camera and its driver do.

OpenCV hands out frames that waited in a buffer, blocks for ever, and says it has read from a camera
that is unplugged. So a thread reads all the time, and whoever asks is never kept waiting by it.
"""

import re
import threading
import time
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ...errors import InputError
from ..image import Picture, picture_from_bytes

MAX_AGE = 0.3
"""Seconds after which a frame says nothing of now."""
SAME = 1.0
"""Seconds for which pixels may stay the very same: noise changes those of a camera that lives."""
OPENING = 10.0
"""Seconds for which a camera is waited for."""
WARM = 5
"""Frames in which a camera finds its exposure."""
CLOSING = 1.0
PAUSE = 0.01


class CameraError(InputError):
    """A camera that does not show what is there now; the text says why."""


@dataclass(frozen=True, eq=False)
class Frame:
    """What a camera saw.

    Attributes:
        pixels: (H, W, 3) BGR uint8.
        seen: when, seconds on this computer's monotonic clock.
    """

    pixels: NDArray[np.uint8]
    seen: float


class Camera:
    """Reads a camera until it is closed.

    Args:
        source: the number of a device, the URL of a stream, or a video file.

    Attributes:
        name: it, without who logs in.
    """

    def __init__(self, source: str) -> None:
        self.name, self._source = re.sub("//[^/@]*@", "//", source), source
        self._pause = 1 / 30 if Path(source).is_file() else 0.0
        self._newest: Frame | None = None
        self._changed = self._begun = time.monotonic()
        self._count, self._over = 0, ""
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._read, name="camera", daemon=True)
        self._thread.start()

    def newest(self, max_age: float = MAX_AGE) -> Frame:
        """The last frame.

        Raises:
            CameraError: there is none so young, or the camera shows the same one all the time.
        """
        now, frame = time.monotonic(), self._newest
        if frame is None or now - frame.seen > max_age:
            age = now - (self._begun if frame is None else frame.seen)
            raise CameraError(
                f"Camera {self.name} {self._over}."
                if self._over
                else f"Camera {self.name} has shown nothing for {age:.1f} s, and {max_age:g} s are "
                "allowed; see whether it is plugged in and not used elsewhere."
            )
        if frame.seen - self._changed > SAME:
            raise CameraError(
                f"Camera {self.name} has shown the very same picture for "
                f"{frame.seen - self._changed:.1f} s, so it hangs; plug it in anew."
            )
        return frame

    def first(self) -> Frame:
        """A frame soon after the camera was opened, which is waited for.

        Raises:
            CameraError: there is none.
        """
        ends = self._begun + OPENING
        while not self._over and time.monotonic() < ends and self._count < WARM:
            time.sleep(PAUSE)
        return (self._over and self._newest) or self.newest()  # a file of one frame is over soon

    def close(self) -> None:
        """Let go of the camera; a read that hangs is not waited for."""
        self._over = "is closed"
        self._closed.set()
        self._thread.join(CLOSING)

    def _read(self) -> None:
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        source, device = self._source, re.fullmatch("[0-9]{1,3}", self._source)
        capture = cv2.VideoCapture(int(source)) if device else cv2.VideoCapture(source)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if not capture.isOpened():
            self._over = "cannot be opened; give the number of a device such as 0, a URL or a file"
            return
        while not self._closed.wait(self._pause):
            ok, pixels = capture.read()
            if not ok:
                self._over = "gives no frames any more: it was unplugged, or its file is at its end"
                break
            seen, before = time.monotonic(), self._newest
            if before is None or not np.array_equal(before.pixels, pixels):
                self._changed = seen
            self._newest = Frame(np.asarray(pixels, np.uint8), seen)
            self._count += 1
        capture.release()


def picture_taken(source: str) -> Picture:
    """What a camera sees now.

    Raises:
        CameraError: it shows nothing that can be used.
    """
    camera = Camera(source)
    try:
        frame = camera.first()
    finally:
        camera.close()
    file = BytesIO()
    Image.fromarray(frame.pixels[..., ::-1]).save(file, "PNG")
    return replace(picture_from_bytes(file.getvalue(), "camera.png"), notes=(f"by {camera.name}",))
