"""Gives a camera's newest frame and its age, whatever the camera and its driver do.

OpenCV may return frames that waited in a buffer, block for ever, or claim to have read from a
camera that is unplugged. So a thread reads continuously, and callers never wait for a read.
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
"""Age in seconds beyond which a frame no longer shows what is there now."""
SAME = 1.0
"""Seconds for which all pixels may stay identical: noise changes those of a live camera."""
OPENING = 10.0
"""Seconds to wait for a camera to open."""
WARM = 5
"""Number of frames that a camera takes to find its exposure."""
CLOSING = 1.0
PAUSE = 0.01


class CameraError(InputError):
    """Raised for a camera that does not show what is there now; the message says why."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame of a camera.

    Attributes:
        pixels: (H, W, 3) BGR uint8.
        seen: when it was read, seconds on this computer's monotonic clock.
    """

    pixels: NDArray[np.uint8]
    seen: float


class Camera:
    """A camera that a thread reads until it is closed.

    Args:
        source: the number of a device, the URL of a stream, or a video file.

    Attributes:
        name: the source, without a URL's login.
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
        """Return the newest frame.

        Raises:
            CameraError: it is older than `max_age` seconds, there is none, or the camera keeps
                showing the same one.
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
        """Wait until the camera has found its exposure, 10 s at most, and return a frame.

        Raises:
            CameraError: there is no frame that can be used, see `newest`.
        """
        ends = self._begun + OPENING
        while not self._over and time.monotonic() < ends and self._count < WARM:
            time.sleep(PAUSE)
        return (self._over and self._newest) or self.newest()  # a one-frame file ends at once

    def close(self) -> None:
        """Release the camera, without waiting for a read that hangs."""
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
    """Take a picture with a camera.

    Raises:
        CameraError: the camera shows nothing that can be used.
    """
    camera = Camera(source)
    try:
        frame = camera.first()
    finally:
        camera.close()
    file = BytesIO()
    Image.fromarray(frame.pixels[..., ::-1]).save(file, "PNG")
    return replace(picture_from_bytes(file.getvalue(), "camera.png"), notes=(f"by {camera.name}",))
