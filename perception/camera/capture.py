"""The capture process of a live camera: it grabs, and sends the newest frame over the socket that is its stdin.

`python -m perception.camera.capture REQUEST`, started by `capture_process` only. It ends when the other end of the
socket is shut or closed, even while its driver hangs (docs/decisions/0076).
"""

import os
import socket
import sys
import threading
import time
import traceback
from contextlib import suppress

import cv2
import msgspec
import numpy as np

from perception.camera.capture_messages import (
    CaptureRequest,
    CaptureSettings,
    FrameHeader,
    NotOpened,
    Opened,
    encode_message,
)
from perception.camera.errors import CameraError, CameraNotFound, SettingRefused
from perception.camera.frame import Image
from perception.camera.grey import as_grey

RELEASE_S = 0.3
"""How long the driver may take to come back and let the camera go, before the process ends without it."""


def main() -> None:
    """Open, answer, send frames until the socket is shut or the camera gives none; then end without clean-up."""
    request = msgspec.json.decode(sys.argv[1], type=CaptureRequest)
    link = socket.socket(fileno=sys.stdin.fileno())
    stopping = threading.Event()
    threading.Thread(target=_watch, args=(link, stopping), daemon=True).start()
    try:
        _serve(request, link, stopping)
    except BrokenPipeError:
        pass  # The other end has been shut meanwhile.
    except Exception:
        traceback.print_exc()
    _end()


def _serve(request: CaptureRequest, link: socket.socket, stopping: threading.Event) -> None:
    try:
        capture = open_capture(request)
    except CameraError as error:
        link.sendall(encode_message(NotOpened(type(error).__name__, str(error))))
        return
    link.sendall(encode_message(Opened()))
    sender = _Sender(link)
    _grab(capture, request, sender, stopping)
    capture.release()
    sender.finish()


def _watch(link: socket.socket, stopping: threading.Event) -> None:
    """Wait for the other end of the socket to go, and end the process soon after, whatever the driver does."""
    with suppress(OSError):
        link.recv(1)
    stopping.set()
    time.sleep(RELEASE_S)
    _end()


def _end() -> None:
    # Not sys.exit: a thread that comes back from the driver into an interpreter that ends would abort it.
    sys.stderr.flush()
    os._exit(0)


def open_capture(request: CaptureRequest) -> cv2.VideoCapture:
    """Open the source and apply the settings.

    Raises:
        CameraNotFound: it cannot be opened.
        SettingRefused: it does not take a setting.
    """
    place, device = request.source.place, request.source.kind == "device"
    milliseconds = int(request.timeout * 1e3)
    timeouts = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, milliseconds, cv2.CAP_PROP_READ_TIMEOUT_MSEC, milliseconds]
    capture = cv2.VideoCapture(place, cv2.CAP_V4L2 if device else cv2.CAP_FFMPEG, [] if device else timeouts)
    if not capture.isOpened():
        raise CameraNotFound(f"camera {request.name}: {place} cannot be opened")
    apply_settings(capture, request.settings, request.name)
    return capture


def _grab(
    capture: cv2.VideoCapture, request: CaptureRequest, sender: "_Sender", stopping: threading.Event
) -> None:
    sequence = 0
    while not stopping.is_set() and capture.grab():
        stamp = _stamp(capture, request)
        got, image = capture.retrieve()
        if not got:
            return
        sender.offer(
            sequence, stamp, as_grey(image) if request.settings.grey else np.asarray(image, np.uint8)
        )
        sequence += 1


def _stamp(capture: cv2.VideoCapture, request: CaptureRequest) -> float:
    now = time.monotonic()
    if request.source.kind == "device":
        # The kernel stamps V4L2 buffers on the monotonic clock, which is asyncio's own.
        kernel = capture.get(cv2.CAP_PROP_POS_MSEC) * 1e-3
        if 0.0 <= now - kernel < request.timeout:
            now = kernel
    return now - request.settings.delay


class _Sender:
    """Sends the newest frame in a thread of its own, so that a reader that is late does not keep the grabbing."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self._changed = threading.Condition()
        self._newest: tuple[FrameHeader, Image] | None = None
        self._finished = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def offer(self, sequence: int, stamp: float, image: Image) -> None:
        """Put a frame in the place of one that has not been sent yet."""
        with self._changed:
            self._newest = FrameHeader(sequence, stamp, image.shape), np.ascontiguousarray(image)
            self._changed.notify()

    def finish(self) -> None:
        """Wait until the last frame has been sent."""
        with self._changed:
            self._finished = True
            self._changed.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._newest is not None or self._finished)
                newest, self._newest = self._newest, None
            if newest is None:
                return
            header, image = newest
            try:
                self._link.sendall(encode_message(header))
                self._link.sendall(image.data.cast("B"))
            except OSError:
                return


def apply_settings(capture: cv2.VideoCapture, settings: CaptureSettings, name: str) -> None:
    """Ask the camera for its settings and read them back.

    Raises:
        SettingRefused: it has another value; the message has both.
    """
    if settings.pixel_format is not None:
        code = cv2.VideoWriter.fourcc(*settings.pixel_format)
        _set(capture, cv2.CAP_PROP_FOURCC, code, "format", name, 0.0)
    for value, key, what in (
        (settings.width, cv2.CAP_PROP_FRAME_WIDTH, "width"),
        (settings.height, cv2.CAP_PROP_FRAME_HEIGHT, "height"),
    ):
        if value is not None:
            _set(capture, key, float(value), what, name, 0.0)
    if settings.rate is not None:
        _set(capture, cv2.CAP_PROP_FPS, settings.rate, "rate", name, 0.05)
    if settings.exposure is not None:
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, 1)
        _set(capture, cv2.CAP_PROP_EXPOSURE, settings.exposure, "exposure", name, 0.1)
    if settings.gain is not None:
        _set(capture, cv2.CAP_PROP_GAIN, settings.gain, "gain", name, 0.1)


def _set(capture: cv2.VideoCapture, key: int, value: float, what: str, name: str, tolerance: float) -> None:
    capture.set(key, value)
    actual = capture.get(key)
    if abs(actual - value) > tolerance * abs(value):
        raise SettingRefused(f"camera {name}: {what} {value:g} was asked for, it gives {actual:g}")


if __name__ == "__main__":
    main()
