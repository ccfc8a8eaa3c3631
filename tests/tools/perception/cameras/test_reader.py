"""Cameras that hang, freeze, are unplugged or not there: each is refused in a sentence, at once."""

import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from formup.tools.perception.cameras.reader import Camera, CameraError, picture_taken


class Device:
    """In `cv2.VideoCapture`'s place; does what its mode says."""

    def __init__(self) -> None:
        self.mode, self.there, self.over = "lives", True, threading.Event()
        self.released = False
        self._n = 0

    def __call__(self, source: Any) -> "Device":
        if self.mode == "never opens":
            self.over.wait()
        return self

    def isOpened(self) -> bool:  # noqa: N802
        return self.there

    def set(self, name: int, value: float) -> bool:
        return False

    def read(self) -> tuple[bool, np.ndarray | None]:
        self.over.wait(0.02)
        if self.mode == "hangs":
            self.over.wait()
        if self.mode == "unplugged":
            return False, None
        self._n += self.mode == "lives"
        return True, np.full((90, 160, 3), self._n % 250, np.uint8)

    def release(self) -> None:
        self.released = True


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> Iterator[Device]:
    made = Device()
    monkeypatch.setattr(cv2, "VideoCapture", made)
    yield made
    made.over.set()


@pytest.fixture
def camera(device: Device) -> Iterator[Camera]:
    made = Camera("0")
    made.first()
    yield made
    made.close()


def refused(camera: Camera, words: str) -> None:
    """It comes to be refused with these words, within some seconds."""
    ends = time.monotonic() + 10
    while True:
        try:
            camera.newest()
        except CameraError as error:
            assert words in str(error)
            return
        assert time.monotonic() < ends, "it was never refused"
        time.sleep(0.02)


def test_the_newest_frame_is_had_at_once(camera: Camera) -> None:
    first = camera.newest()
    assert first.pixels.shape == (90, 160, 3)
    assert 0 <= time.monotonic() - first.seen <= 0.3
    ends = time.monotonic() + 10
    while camera.newest().seen == first.seen:
        assert time.monotonic() < ends


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        ("hangs", "has shown nothing for"),
        ("freezes", "has shown the very same picture for"),
        ("unplugged", "gives no frames any more"),
    ],
)
def test_what_is_not_now_is_refused(camera: Camera, device: Device, mode: str, words: str) -> None:
    device.mode = mode
    refused(camera, words)


def test_a_camera_that_lives_again_is_believed_again(camera: Camera, device: Device) -> None:
    device.mode = "freezes"
    refused(camera, "the very same picture")
    device.mode = "lives"
    ends = time.monotonic() + 10
    while True:
        try:
            camera.newest()
            return
        except CameraError:
            assert time.monotonic() < ends


def test_a_frame_may_be_no_older_than_is_asked(camera: Camera, device: Device) -> None:
    device.mode = "hangs"
    refused(camera, "0.3 s are allowed")
    assert camera.newest(max_age=60).pixels.shape == (90, 160, 3)


@pytest.mark.parametrize("mode", ["hangs", "never opens"])
def test_closing_does_not_wait_for_what_hangs(device: Device, mode: str) -> None:
    device.mode = mode
    made = Camera("0")
    made.close()
    with pytest.raises(CameraError, match="is closed"):
        made.newest()
    assert not device.over.is_set()


def test_a_camera_is_let_go_of(camera: Camera, device: Device) -> None:
    camera.close()
    assert device.released


def test_a_camera_that_is_not_there(device: Device) -> None:
    device.there = False
    with pytest.raises(CameraError, match="Camera 7 cannot be opened; give the number of a device"):
        picture_taken("7")


@pytest.mark.parametrize(
    "source", ["none.avi", "http://127.0.0.1:1/stream.mjpg", "250", "9" * 40, ""]
)
def test_opencv_s_own_refusals(source: str, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(CameraError, match="cannot be opened"):
        picture_taken(source)
    assert capfd.readouterr().err == ""


def test_who_logs_in_is_not_told(device: Device) -> None:
    device.there = False
    with pytest.raises(CameraError, match=r"Camera rtsp://10\.0\.0\.9/top cannot") as refusal:
        picture_taken("rtsp://me:secret@10.0.0.9/top")
    assert "secret" not in str(refusal.value)


class Stream(BaseHTTPRequestHandler):
    """A network camera: JPEG after JPEG, until `over` is set."""

    over = threading.Event()

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        for n in range(10_000):
            pixels = np.full((96, 160, 3), (10, n % 200, 200), np.uint8)
            data = cv2.imencode(".jpg", pixels)[1].tobytes()
            head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
            try:
                self.wfile.write(head.encode() + data + b"\r\n")
            except OSError:
                return  # the camera was let go of
            if self.over.wait(0.02):
                self.over = threading.Event()
                self.over.wait(10)  # says nothing more, with the line open
                return

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


def test_a_stream_that_stops_is_refused() -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), Stream) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        camera = Camera(f"http://127.0.0.1:{server.server_address[1]}/top.mjpg")
        try:
            assert camera.first().pixels.shape == (96, 160, 3)
            Stream.over.set()
            refused(camera, "has shown nothing for")
        finally:
            camera.close()
            server.shutdown()


def test_a_video_file_is_a_camera(tmp_path: Path) -> None:
    path = str(tmp_path / "film.avi")
    film = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 20, (160, 96))
    for n in range(10):
        film.write(np.full((96, 160, 3), (10, 20 * n, 200), np.uint8))
    film.release()
    picture = picture_taken(path)
    assert picture.size == (160, 96)
    assert abs(int(picture.pixels[48, 80, 0]) - 200) < 12  # red comes first
