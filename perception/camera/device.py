"""A live camera: captured in a process of its own, opened again when it is lost, its newest frame in a slot."""

import asyncio
import logging
from dataclasses import replace

from perception.camera.capture_messages import CaptureRequest, CaptureSettings
from perception.camera.capture_process import CaptureProcess
from perception.camera.errors import CameraError, CameraNotFound
from perception.camera.slot import SlotCamera
from perception.camera.source import Source, find_source

log = logging.getLogger(__name__)
AS_IT_IS = CaptureSettings()
_FIRST_BACKOFF_S, _LAST_BACKOFF_S = 0.2, 5.0
_START_S = 5.0
"""What the start of the capture process may add to the time in which a camera must open."""


class DeviceCamera(SlotCamera):
    """A V4L2 device or an address, captured in a process of its own.

    A camera that vanishes, stalls or changes its size raises its typed error from `latest` and `frames`
    and is opened again in the background, first after 0.2 s and then ever more slowly up to every 5 s.
    """

    def __init__(
        self,
        source: Source,
        settings: CaptureSettings = AS_IT_IS,
        *,
        name: str = "",
        stall_after: float = 2.0,
    ) -> None:
        super().__init__(name or source.place, stall_after=stall_after)
        self._request = CaptureRequest(source, settings, self.name, stall_after)
        self._keeper: asyncio.Task[None] | None = None
        self._sequence = 0

    async def open(self) -> None:
        """Open the camera.

        Raises:
            CameraNotFound, SettingRefused: it cannot be opened, or not with these settings.
        """
        capture = await self._start()
        # Only now: the start of the process is no silence of the camera.
        await super().open()
        self._keeper = asyncio.create_task(self._keep_open(capture), name=f"camera {self.name}")

    async def close(self) -> None:
        """Release the camera and end its process, at the latest 1.2 s from now, whatever its driver does."""
        if self._keeper is not None:
            self._keeper.cancel()
            await asyncio.wait([self._keeper])
            self._keeper = None

    async def _start(self) -> CaptureProcess:
        capture = CaptureProcess.start(self._request)
        try:
            async with asyncio.timeout(self.stall_after + _START_S):
                await capture.opened()
        except BaseException as error:
            await capture.end()
            if isinstance(error, TimeoutError):
                raise CameraNotFound(f"camera {self.name} does not answer while it is opened") from None
            raise
        return capture

    async def _keep_open(self, capture: CaptureProcess) -> None:
        while True:
            try:
                await self._take_frames(capture)
            except CameraError as error:
                log.warning("%s; opening it again", error)
                self.fail(error)
            finally:
                await capture.end()
            capture = await self._reopen()

    async def _take_frames(self, capture: CaptureProcess) -> None:
        """Put frames into the slot until the camera fails."""
        first = self._sequence + 1
        while True:
            try:
                async with asyncio.timeout(self.stall_after):
                    frame = await capture.frame()
            except TimeoutError:
                raise self._stalled() from None
            self._sequence = first + frame.sequence
            self.put(replace(frame, sequence=self._sequence))
            if self._error is not None:
                raise self._error

    async def _reopen(self) -> CaptureProcess:
        pause = _FIRST_BACKOFF_S
        while True:
            await asyncio.sleep(pause)
            try:
                capture = await self._start()
            except CameraError as error:
                log.debug("camera %s still down: %s", self.name, error)
                pause = min(2.0 * pause, _LAST_BACKOFF_S)
                continue
            self.reopened()
            log.info("camera %s is open again", self.name)
            return capture


def open_camera(
    text: str, settings: CaptureSettings = AS_IT_IS, *, name: str = "", repeat: bool = False
) -> SlotCamera:
    """The camera that a text names, not yet opened.

    Args:
        text: as `find_source` takes it.
        settings: a folder or video takes `rate` (25 Hz by default) and `grey` of them.
        repeat: whether a folder or video begins again at its end.

    Raises:
        CameraNotFound: there is no such thing.
    """
    source = find_source(text)
    if source.kind in ("folder", "video"):
        # Only what reads files itself needs OpenCV in this process.
        from perception.camera.recorded import RecordedCamera

        rate = 25.0 if settings.rate is None else settings.rate
        return RecordedCamera(source, name=name, rate=rate, grey=settings.grey, repeat=repeat)
    return DeviceCamera(source, settings, name=name)
