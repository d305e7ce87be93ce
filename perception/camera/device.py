"""A live camera through OpenCV: one thread that grabs, the loop that takes the newest frame."""

import asyncio
import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.camera.errors import CameraError, CameraLost, CameraNotFound, SettingRefused
from perception.camera.frame import Frame
from perception.camera.recorded import RecordedCamera, as_grey
from perception.camera.slot import SlotCamera
from perception.camera.source import Source, find_source

logger = logging.getLogger(__name__)
_FIRST_BACKOFF, _LAST_BACKOFF = 0.2, 5.0


@dataclass(frozen=True)
class CaptureSettings:
    """What is asked of the camera; None leaves it as it is.

    ``pixel_format`` is a four-letter code such as GREY, YUYV or MJPG; ``exposure`` and ``gain`` are in the
    driver's own units and switch automatic exposure off. ``delay`` is the known time in seconds from the
    middle of the exposure to the driver's stamp; it is taken off every stamp.
    """

    width: int | None = None
    height: int | None = None
    rate: float | None = None
    pixel_format: str | None = None
    exposure: float | None = None
    gain: float | None = None
    delay: float = 0.0
    grey: bool = True


class DeviceCamera(SlotCamera):
    """A V4L2 device or an address, captured in a thread of its own.

    A camera that vanishes, stalls or changes its size raises its typed error from ``latest`` and ``frames``
    and is opened again in the background, first after 0.2 s and then ever more slowly up to every 5 s.
    """

    def __init__(
        self,
        source: Source,
        settings: CaptureSettings = CaptureSettings(),
        *,
        name: str = "",
        stall_after: float = 2.0,
    ) -> None:
        super().__init__(name or source.place, stall_after=stall_after)
        self._source = source
        self._settings = settings
        self._keeper: asyncio.Task[None] | None = None
        self._grabber: _Grabber | None = None
        self._sequence = 0

    async def open(self) -> None:
        """Open the camera and start its thread; raises CameraNotFound or SettingRefused."""
        await super().open()
        await self._start_grabber()
        self._keeper = asyncio.create_task(self._keep_open(), name=f"camera {self.name}")

    async def close(self) -> None:
        """Let the camera go."""
        if self._keeper is not None:
            self._keeper.cancel()
            with suppress(asyncio.CancelledError):
                await self._keeper
            self._keeper = None
        if self._grabber is not None:
            self._grabber.stop()
            self._grabber = None

    async def _start_grabber(self) -> None:
        loop = asyncio.get_running_loop()
        grabber = _Grabber(self._source, self._settings, self.name, self.stall_after, loop, self._take)
        opening = asyncio.ensure_future(asyncio.to_thread(grabber.open))
        try:
            await asyncio.wait_for(asyncio.shield(opening), self.stall_after + 5.0)
        except (TimeoutError, asyncio.CancelledError) as error:
            opening.add_done_callback(lambda _: grabber.release())
            if isinstance(error, asyncio.CancelledError):
                raise
            raise CameraNotFound(f"camera {self.name} does not answer while it is opened") from None
        self._grabber = grabber
        grabber.start()

    def _take(self, grabber: "_Grabber", frame: Frame | None) -> None:
        """In the loop: a frame of the grabber, or None when it has ended."""
        if grabber is not self._grabber:
            return
        if frame is None:
            self.fail(CameraLost(f"camera {self.name} is gone: {self._source.place} gives no more pictures"))
            return
        lost = frame.sequence - grabber.delivered - 1
        grabber.delivered = frame.sequence
        self._sequence += 1 + lost
        self.put(replace(frame, sequence=self._sequence))

    async def _keep_open(self) -> None:
        seen = -1
        while True:
            try:
                seen = await self.wait_for_frame(seen)
            except CameraError as error:
                logger.warning("%s; opening it again", error)
                self.fail(error)
                await self._reopen()

    async def _reopen(self) -> None:
        if self._grabber is not None:
            self._grabber.stop()
            self._grabber = None
        pause = _FIRST_BACKOFF
        while True:
            await asyncio.sleep(pause)
            try:
                await self._start_grabber()
            except CameraError as error:
                logger.debug("camera %s still down: %s", self.name, error)
                pause = min(2.0 * pause, _LAST_BACKOFF)
                continue
            self.reopened()
            logger.info("camera %s is open again", self.name)
            return


class _Grabber:
    """One opened capture and its thread; abandoned, not joined, when the driver hangs inside a read."""

    def __init__(
        self,
        source: Source,
        settings: CaptureSettings,
        name: str,
        patience: float,
        loop: asyncio.AbstractEventLoop,
        take: Callable[["_Grabber", Frame | None], None],
    ) -> None:
        self.delivered = -1
        self._source, self._settings, self._name, self._patience = source, settings, name, patience
        self._loop, self._take = loop, take
        self._capture: cv2.VideoCapture | None = None
        self._stopping = threading.Event()
        self._lock = threading.Lock()
        self._waiting: Frame | None = None

    def open(self) -> None:
        device = self._source.kind == "device"
        milliseconds = int(self._patience * 1e3)
        limits = (
            []
            if device
            else [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, milliseconds, cv2.CAP_PROP_READ_TIMEOUT_MSEC, milliseconds]
        )
        backend = cv2.CAP_V4L2 if device else cv2.CAP_FFMPEG
        capture = cv2.VideoCapture(self._source.place, backend, limits)
        if not capture.isOpened():
            capture.release()
            raise CameraNotFound(f"camera {self._name}: {self._source.place} cannot be opened")
        try:
            apply_settings(capture, self._settings, self._name)
        except SettingRefused:
            capture.release()
            raise
        self._capture = capture

    def start(self) -> None:
        threading.Thread(target=self._run, name=f"camera {self._name}", daemon=True).start()

    def stop(self) -> None:
        self._stopping.set()

    def release(self) -> None:
        """Let go of a capture whose opening nobody waits for any more."""
        if self._capture is not None:
            self._capture.release()

    def _run(self) -> None:
        capture = self._capture
        assert capture is not None
        sequence = 0
        while not self._stopping.is_set():
            if not capture.grab():
                break
            stamp = self._stamp(capture)
            got, picture = capture.retrieve()
            if not got:
                break
            image = as_grey(picture) if self._settings.grey else np.asarray(picture, np.uint8)
            self._offer(Frame(image, stamp, self._name, sequence))
            sequence += 1
        capture.release()
        if not self._stopping.is_set():
            self._tell(lambda: self._take(self, None))

    def _stamp(self, capture: cv2.VideoCapture) -> float:
        now = self._loop.time()
        if self._source.kind == "device":
            # The kernel stamps V4L2 buffers on the monotonic clock, which is asyncio's own.
            kernel = capture.get(cv2.CAP_PROP_POS_MSEC) * 1e-3
            if 0.0 <= now - kernel < self._patience:
                now = kernel
        return now - self._settings.delay

    def _offer(self, frame: Frame) -> None:
        with self._lock:
            asked = self._waiting is not None
            self._waiting = frame
        if not asked:
            self._tell(self._deliver)

    def _deliver(self) -> None:
        with self._lock:
            frame, self._waiting = self._waiting, None
        if frame is not None:
            self._take(self, frame)

    def _tell(self, call: Callable[[], None]) -> None:
        with suppress(RuntimeError):  # the loop has been closed meanwhile
            self._loop.call_soon_threadsafe(call)


def apply_settings(capture: cv2.VideoCapture, settings: CaptureSettings, name: str) -> None:
    """Ask the camera for its settings and read them back; raises SettingRefused with both values."""
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


def open_camera(
    text: str, settings: CaptureSettings = CaptureSettings(), *, name: str = "", repeat: bool = False
) -> SlotCamera:
    """The camera that ``text`` names, not yet opened; raises CameraNotFound."""
    source = find_source(text)
    if source.kind in ("folder", "film"):
        rate = 25.0 if settings.rate is None else settings.rate
        return RecordedCamera(source, name=name, rate=rate, grey=settings.grey, repeat=repeat)
    return DeviceCamera(source, settings, name=name)
